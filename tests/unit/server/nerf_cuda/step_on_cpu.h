#pragma once

// Random fields and one training step on the CPU, to hold the CUDA kernels against.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "server/nerf/cpu/field_model.h"
#include "server/nerf/cpu/kernels.h"
#include "server/nerf/math/composite.h"
#include "server/nerf/math/random.h"

namespace romap::nerf {

// Empty when every |got - want| is within `tolerance` times the largest |want|; otherwise says where it is not. NaN and
// infinities on either side are differences.
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

// A field whose table holds noise, so that it varies from cell to cell.
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

// Rays through the unit cube: objects with and without depth, background, and some that miss.
inline std::vector<Ray> TestRays(int count) {
  std::vector<Ray> rays(static_cast<size_t>(count));
  for (size_t r = 0; r < rays.size(); ++r) {
    Ray& ray = rays[r];
    const auto random = [&](uint64_t stream) { return RandomUniform(5, stream, r); };
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
  }
  return rays;
}

// What a step is made of besides the field. The cut is large enough to drop some samples.
struct StepInput {
  std::vector<Ray> rays;
  LossWeights loss_weights;
  float gradient_cut = 2e-2f;

  float gradient_scale() const { return 1.0f / static_cast<float>(rays.size()); }
};

inline StepInput TestStep(int rays, bool random_background) {
  StepInput input{.rays = TestRays(rays), .loss_weights = {}};
  input.loss_weights = {.opacity_object = 0.5f,
                        .opacity_background = 0.4f,
                        .density = 0.01f,
                        .depth = 0.5f,
                        .depth_limit = 0.3f,
                        .random_background = random_background};
  return input;
}

// The samples of a step and what the CPU makes of them.
struct StepOnCpu {
  SampleChunk chunk;
  std::vector<RaySpan> spans;
  std::vector<RayResult> results;
  AlignedBuffer<float> table_gradient, mlp_gradient;
  int cut_samples = 0;

  StepOnCpu(const FieldModel& field, const StepInput& input)
      : chunk(static_cast<int>(input.rays.size()) * kSamplesPerRay, field.layout.features, field.mlp.hidden),
        spans(input.rays.size()),
        results(input.rays.size(), RayResult{}),
        table_gradient(field.table.size() + kMaxLanes),
        mlp_gradient(field.mlp.parameters.size()) {
    const SamplingRule rule{.max_samples = kSamplesPerRay, .skip_empty = false};
    PlainKernels().place_samples(input.rays.data(), static_cast<int>(input.rays.size()), rule, chunk, spans.data());
  }

  // Adds to the gradients.
  void Run(const KernelTable& kernels, const FieldModel& field, const StepInput& input) {
    SampleChunk& c = chunk;
    kernels.encode(field.layout, field.table.data(), c.size, c.x.data(), c.y.data(), c.z.data(), c.features.data());
    kernels.mlp_forward(field.mlp, c.size, c.features.data(), c.hidden.data(), c.raw.data());
    kernels.activate(c, field.density_bias);
    for (size_t r = 0; r < spans.size(); ++r) Composite(r, input);
    kernels.mlp_backward(field.mlp, c.size, c.features.data(), c.hidden.data(), c.d_raw.data(), mlp_gradient.data());
    kernels.encode_backward(field.layout, c.size, c.x.data(), c.y.data(), c.z.data(), c.features.data(),
                            table_gradient.data());
  }

 private:
  static constexpr int kSamplesPerRay = 12;

  void Composite(size_t r, const StepInput& input) {
    SampleChunk& c = chunk;
    if (spans[r].count == 0) return;
    const int at = spans[r].first;
    const RaySamples samples{spans[r].count,        c.t.data() + at,
                             c.length.data() + at,  c.alpha.data() + at,
                             c.density.data() + at, {c.red.data() + at, c.green.data() + at, c.blue.data() + at}};
    float* d_raw = c.d_raw.data() + kOutputs * at;
    results[r] = plain::CompositeForward(samples, input.rays[r].target, input.loss_weights, c.weight.data() + at,
                                         c.behind.data() + at);
    plain::CompositeBackward(samples, input.rays[r].target, input.loss_weights, results[r], c.weight.data() + at,
                             c.behind.data() + at, d_raw);
    for (int i = 0; i < spans[r].count; ++i, d_raw += kOutputs) {
      const float size = std::fabs(d_raw[0]) + std::fabs(d_raw[1]) + std::fabs(d_raw[2]) + std::fabs(d_raw[3]);
      if (size <= input.gradient_cut) ++cut_samples;
      for (int o = 0; o < kOutputs; ++o) d_raw[o] *= size <= input.gradient_cut ? 0.0f : input.gradient_scale();
    }
  }
};

}  // namespace romap::nerf
