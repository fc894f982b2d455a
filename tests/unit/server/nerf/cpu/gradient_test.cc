// Backward passes of the kernels compared with central differences of their forward passes, in the plain form.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/math/losses.h"
#include "server/nerf/math/random.h"
#include "tests/unit/server/nerf/math/gradient_check.h"

namespace romap::nerf::gradient_test {

using testing_support::ExpectGradient;

float Noise(uint64_t stream, uint64_t i) { return 2.0f * RandomUniform(11, stream, i) - 1.0f; }

NerfConfig SmallConfig() {
  NerfConfig config;
  config.levels = 3;
  config.log2_table_entries = 8;
  config.base_resolution = 4;
  config.finest_resolution = 40;
  config.hidden_width = 16;
  return config;
}

TEST(GradientTest, EncodingIsTheAdjointOfItsForwardPass) {
  const GridLayout layout = MakeGridLayout(SmallConfig());
  const KernelTable& kernels = PlainKernels();
  constexpr int kPoints = 5;
  AlignedBuffer<float> table(layout.entries * 2), gradient(layout.entries * 2);
  AlignedBuffer<float> x(kPoints), y(kPoints), z(kPoints);
  const size_t size = size_t{kPoints} * static_cast<unsigned>(layout.features);
  AlignedBuffer<float> features(size), weights(size);
  for (size_t i = 0; i < table.size(); ++i) table[i] = Noise(1, i);
  for (size_t i = 0; i < size; ++i) weights[i] = Noise(2, i);
  for (size_t i = 0; i < kPoints; ++i) {
    x[i] = RandomUniform(5, 0, i);
    y[i] = RandomUniform(5, 1, i);
    z[i] = RandomUniform(5, 2, i);
  }
  const auto loss = [&] {
    kernels.encode(layout, table.data(), kPoints, x.data(), y.data(), z.data(), features.data());
    double sum = 0;
    for (size_t i = 0; i < size; ++i) sum += weights[i] * features[i];
    return sum;
  };
  kernels.encode_backward(layout, kPoints, x.data(), y.data(), z.data(), weights.data(), gradient.data());
  ExpectGradient(loss, table.data(), gradient.data(), table.size(), table.size(), 0.25f, 1e-4);
}

TEST(GradientTest, MlpPassesGradientsToWeightsAndInputs) {
  constexpr int kPoints = 7, kInputs = 16, kHidden = 16;
  MlpWeights mlp(kInputs, kHidden);
  for (size_t i = 0; i < mlp.parameters.size(); ++i) mlp.parameters[i] = 0.5f * Noise(1, i);
  mlp.UpdateTransposed();
  AlignedBuffer<float> inputs(kPoints * kInputs), hidden(kPoints * kHidden), raw(kPoints * kOutputs);
  AlignedBuffer<float> d_raw(kPoints * kOutputs), gradient(mlp.parameters.size());
  for (size_t i = 0; i < inputs.size(); ++i) inputs[i] = Noise(2, i);
  for (size_t i = 0; i < d_raw.size(); ++i) d_raw[i] = Noise(3, i);
  const auto loss = [&] {
    mlp.UpdateTransposed();
    PlainKernels().mlp_forward(mlp, kPoints, inputs.data(), hidden.data(), raw.data());
    double sum = 0;
    for (size_t i = 0; i < raw.size(); ++i) sum += d_raw[i] * raw[i];
    return sum;
  };
  loss();
  AlignedBuffer<float> d_inputs = inputs.Clone(), d_hidden = hidden.Clone();
  PlainKernels().mlp_backward(mlp, kPoints, d_inputs.data(), d_hidden.data(), d_raw.data(), gradient.data());
  ExpectGradient(loss, mlp.parameters.data(), gradient.data(), gradient.size(), 60, 5e-4f, 1e-2);
  ExpectGradient(loss, inputs.data(), d_inputs.data(), inputs.size(), inputs.size(), 5e-4f, 1e-2);
}

// Two rays with three samples each that are partners.
TEST(GradientTest, ContrastIsPartOfTheGradientOfBothRays) {
  constexpr int kSamples = 3;
  for (const bool random_background : {false, true}) {
    const LossWeights weights{.opacity_object = 0.5f, .contrast = 3.0f, .random_background = random_background};
    std::array<Ray, 2> rays{};
    rays[0].target = {{0.9f, 0.2f, 0.4f}, {0.1f, 0.7f, 0.3f}, -1, true, 1};
    rays[1].target = {{0.3f, 0.6f, 0.1f}, {0.8f, 0.5f, 0.2f}, -1, true, -1};
    const std::array<RaySpan, 2> spans = {RaySpan{0, kSamples}, RaySpan{kSamples, kSamples}};
    SampleChunk chunk(2 * kSamples, 16, 16);
    chunk.size = 2 * kSamples;
    for (int i = 0; i < chunk.size; ++i) {
      chunk.t[static_cast<size_t>(i)] = 2.0f + 0.1f * static_cast<float>(i % kSamples);
      chunk.length[static_cast<size_t>(i)] = 0.1f;
    }
    for (size_t i = 0; i < static_cast<size_t>(chunk.size * kOutputs); ++i) chunk.raw[i] = Noise(8, i);
    std::array<RayResult, 2> results{};
    const auto loss = [&] {
      PlainKernels().activate(chunk, 0);
      PlainKernels().composite(rays.data(), spans.data(), 2, weights, chunk, results.data());
      return results[0].loss + results[1].loss;
    };
    const float whole = loss();
    float error[2][3];
    double squares = 0, contrast = 0;
    for (int r = 0; r < 2; ++r) plain::ColorError(results[r], rays[r].target, weights, error[r]);
    for (int c = 0; c < 3; ++c) {
      squares += error[0][c] * error[0][c] + error[1][c] * error[1][c];
      contrast += (error[0][c] - error[1][c]) * (error[0][c] - error[1][c]);
    }
    EXPECT_NEAR(whole, squares + 3 * contrast + 0.5 * (2 - results[0].opacity - results[1].opacity), 1e-5);
    std::vector<float> d_raw(chunk.d_raw.data(), chunk.d_raw.data() + chunk.size * kOutputs);
    ExpectGradient(loss, chunk.raw.data(), d_raw.data(), chunk.size * kOutputs, chunk.size * kOutputs, 1e-2f, 5e-3);
  }
}

}  // namespace romap::nerf::gradient_test
