#pragma once

// Random fields and one training step on the CPU, the reference for the CUDA kernels.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/math/random.h"
#include "server/nerf/math/sample_budget.h"
#include "server/nerf/model/field_model.h"

namespace romap::nerf {

// Empty if every |got - want| is at most `tolerance` times the largest |want|; otherwise describes the first
// difference. NaN and infinities on either side are differences.
inline std::string Difference(std::span<const float> want, std::span<const float> got, double tolerance) {
  if (want.size() != got.size()) return fmt::format("{} values instead of {}", got.size(), want.size());
  double largest = 0;
  for (const float x : want) largest = std::max(largest, static_cast<double>(std::fabs(x)));
  for (size_t i = 0; i < want.size(); ++i) {
    const double difference = std::fabs(static_cast<double>(want[i]) - static_cast<double>(got[i]));
    if (!(difference <= tolerance * largest) || !std::isfinite(want[i])) {
      return fmt::format("value {}: {} instead of {}, tolerance {}", i, got[i], want[i], tolerance * largest);
    }
  }
  return "";
}

// A field with noise in its table, so that it varies between cells.
inline FieldModel NoisyField(int levels, int hidden_width) {
  NerfConfig config;
  config.levels = levels;
  config.hidden_width = hidden_width;
  config.log2_table_entries = 10;
  config.density_bias = 0.5;
  FieldModel model(config, 7);
  for (size_t i = 0; i < model.table.size(); ++i) model.table[i] = RandomUniform(3, 0, i) - 0.5f;
  return model;
}

// Rays at the unit cube: object rays with and without depth, background rays, and some that miss the cube.
inline std::vector<Ray> TestRays(int count, uint64_t seed) {
  std::vector<Ray> rays(static_cast<size_t>(count));
  for (size_t r = 0; r < rays.size(); ++r) {
    Ray& ray = rays[r];
    const auto random = [&](uint64_t stream) { return RandomUniform(seed, stream, r); };
    const float from[3] = {-1.0f, random(0), random(1)};
    const float to[3] = {0.5f, random(2), r % 10 == 9 ? 9.0f : random(3)};
    const float length = std::hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
    for (int a = 0; a < 3; ++a) {
      ray.origin[a] = from[a];
      ray.direction[a] = (to[a] - from[a]) / length;
      ray.target.rgb[a] = random(4 + static_cast<uint64_t>(a));
      ray.target.background[a] = random(7 + static_cast<uint64_t>(a));
    }
    ray.jitter = random(10);
    ray.target.is_object = r % 3 != 0;
    if (r % 3 == 1) ray.target.depth = 1.0f + random(11);
    if (r % 6 == 4 && r + 1 < rays.size()) ray.target.partner = 1;
    if (r % 6 == 5) ray.target.partner = -1;
  }
  return rays;
}

// The input of a step besides the field. The gradient cut is large enough to exclude some samples; the box is not a
// cube, and the grid is rotated and shifted relative to it.
struct StepInput {
  std::vector<Ray> rays;
  SampleBudget budget;
  LossWeights loss_weights;
  float gradient_cut = 2e-2f;
  std::array<float, 3> extent = {1.0f, 0.8f, 0.9f};
  GridPose grid = {.rotation = {{0.96f, -0.28f, 0}, {0.28f, 0.96f, 0}, {0, 0, 1}}, .shift = {0.2f, -0.03f, 0.05f}};
  std::vector<uint32_t> occupied_bits;

  float gradient_scale() const { return 1.0f / static_cast<float>(rays.size()); }
};

inline StepInput TestStep(int rays, SampleBudget budget, bool random_background) {
  StepInput input{.rays = TestRays(rays, 5), .budget = budget, .loss_weights = {}, .occupied_bits = {}};
  input.loss_weights = {.opacity_object = 0.5f,
                        .opacity_background = 0.4f,
                        .density = 0.01f,
                        .depth = 0.5f,
                        .contrast = 1.5f,
                        .depth_limit = 0.3f,
                        .random_background = random_background};
  constexpr size_t kWords = size_t{kOccupancyResolution} * kOccupancyResolution * kOccupancyResolution / 32;
  for (size_t word = 0; word < kWords; ++word) {  // about a quarter of the cells
    input.occupied_bits.push_back(static_cast<uint32_t>(RandomBits(9, 0, word) & RandomBits(9, 1, word)));
  }
  return input;
}

// The arrays of one step on the CPU.
struct StepOnCpu {
  SampleChunk chunk;
  std::vector<RaySpan> spans;
  std::vector<RayResult> results;
  AlignedBuffer<float> table_gradient, mlp_gradient;
  int active_samples = 0;

  StepOnCpu(const FieldModel& field, const StepInput& input)
      : chunk(static_cast<int>(input.rays.size()) * input.budget.max_samples, field.layout.features, field.mlp.hidden),
        spans(input.rays.size()),
        results(input.rays.size(), RayResult{}),
        table_gradient(field.table.size() + kMaxLanes),
        mlp_gradient(field.mlp.parameters.size()) {
    const SamplingRule rule{
        .occupied_bits = input.occupied_bits.data(), .extent = input.extent, .budget = input.budget};
    PlainKernels().place_samples(input.rays.data(), static_cast<int>(input.rays.size()), rule, chunk, spans.data());
    PlainKernels().to_grid(input.grid, chunk.size, chunk.x.data(), chunk.y.data(), chunk.z.data());
  }

  // Adds to the gradients.
  void Run(const KernelTable& kernels, const FieldModel& field, const StepInput& input) {
    SampleChunk& c = chunk;
    kernels.encode(field.layout, field.table.data(), c.size, c.x.data(), c.y.data(), c.z.data(), c.features.data());
    kernels.mlp_forward(field.mlp, c.size, c.features.data(), c.hidden.data(), c.raw.data());
    kernels.activate(c, field.density_bias);
    Composite(input);
    kernels.mlp_backward(field.mlp, c.size, c.features.data(), c.hidden.data(), c.d_raw.data(), mlp_gradient.data());
    kernels.encode_backward(field.layout, c.size, c.x.data(), c.y.data(), c.z.data(), c.features.data(),
                            table_gradient.data());
  }

  // Like Run, but with the factors of the MLP's products rounded as on tensor cores.
  void RunRounded(const FieldModel& field, const StepInput& input) {
    SampleChunk& c = chunk;
    PlainKernels().encode(field.layout, field.table.data(), c.size, c.x.data(), c.y.data(), c.z.data(),
                          c.features.data());
    for (size_t i = 0; i < static_cast<size_t>(c.size); ++i) ForwardRounded(field, i);
    PlainKernels().activate(c, field.density_bias);
    Composite(input);
    for (size_t i = 0; i < static_cast<size_t>(c.size); ++i) BackwardRounded(field, i);
    PlainKernels().encode_backward(field.layout, c.size, c.x.data(), c.y.data(), c.z.data(), c.features.data(),
                                   table_gradient.data());
  }

  // Squared color error of every ray as the device reports it: -1 for rays without one.
  std::vector<float> ColorLosses(const StepInput& input) const {
    std::vector<float> losses;
    for (size_t r = 0; r < spans.size(); ++r) {
      losses.push_back(spans[r].count > 0 && input.rays[r].target.is_object ? results[r].color_loss : -1.0f);
    }
    return losses;
  }

 private:
  // Rounds to 11 bits, for any exponent.
  static float Rounded(float x) {
    int exponent = 0;
    const float mantissa = std::frexp(x, &exponent);
    return std::ldexp(static_cast<float>(static_cast<_Float16>(mantissa)), exponent);
  }

  void ForwardRounded(const FieldModel& field, size_t i) {
    const size_t inputs = static_cast<size_t>(field.mlp.inputs), width = static_cast<size_t>(field.mlp.hidden);
    float* feature = chunk.features.data() + inputs * i;
    float* neuron = chunk.hidden.data() + width * i;
    for (size_t f = 0; f < inputs; ++f) feature[f] = Rounded(feature[f]);
    for (size_t n = 0; n < width; ++n) {
      float sum = 0;
      for (size_t f = 0; f < inputs; ++f) sum += feature[f] * Rounded(field.mlp.in_weights()[f * width + n]);
      neuron[n] = Rounded(std::max(sum, 0.0f));
    }
    for (size_t o = 0; o < kOutputs; ++o) {
      float sum = 0;
      for (size_t n = 0; n < width; ++n) sum += neuron[n] * Rounded(field.mlp.out_weights()[o * width + n]);
      chunk.raw[kOutputs * i + o] = sum;
    }
  }

  void BackwardRounded(const FieldModel& field, size_t i) {
    const size_t inputs = static_cast<size_t>(field.mlp.inputs), width = static_cast<size_t>(field.mlp.hidden);
    float* feature = chunk.features.data() + inputs * i;
    float* neuron = chunk.hidden.data() + width * i;
    const float* d_raw = chunk.d_raw.data() + kOutputs * i;
    for (size_t n = 0; n < width; ++n) {
      float d_neuron = 0;
      for (size_t o = 0; o < kOutputs; ++o) {
        d_neuron += Rounded(d_raw[o]) * Rounded(field.mlp.out_weights()[o * width + n]);
        mlp_gradient[(inputs + o) * width + n] += Rounded(d_raw[o]) * neuron[n];
      }
      neuron[n] = neuron[n] > 0 ? Rounded(d_neuron) : 0.0f;
    }
    for (size_t f = 0; f < inputs; ++f) {
      float d_feature = 0;
      for (size_t n = 0; n < width; ++n) {
        d_feature += neuron[n] * Rounded(field.mlp.in_weights()[f * width + n]);
        mlp_gradient[f * width + n] += feature[f] * neuron[n];
      }
      feature[f] = d_feature;
    }
  }

  void Composite(const StepInput& input) {
    PlainKernels().composite(input.rays.data(), spans.data(), static_cast<int>(spans.size()), input.loss_weights, chunk,
                             results.data());
    for (int i = 0; i < chunk.size; ++i) {
      float* d_raw = chunk.d_raw.data() + kOutputs * i;
      const float size = std::fabs(d_raw[0]) + std::fabs(d_raw[1]) + std::fabs(d_raw[2]) + std::fabs(d_raw[3]);
      const bool active = size > input.gradient_cut;
      active_samples += active;
      for (int o = 0; o < kOutputs; ++o) d_raw[o] *= active ? input.gradient_scale() : 0.0f;
    }
  }
};

}  // namespace romap::nerf
