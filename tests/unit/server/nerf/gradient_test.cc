// Every backward pass against central differences of its forward pass, in the plain form of the formulas.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/math/activation.h"
#include "server/nerf/math/composite.h"
#include "server/nerf/math/random.h"
#include "tests/unit/server/nerf/gradient_check.h"

namespace romap::nerf {
namespace {

using testing::ExpectGradient;

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

TEST(GradientTest, EncodingScattersWhatItGathered) {
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
  testing::ExpectGradient(loss, table.data(), gradient.data(), table.size(), table.size(), 0.25f, 1e-4);
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
  testing::ExpectGradient(loss, mlp.parameters.data(), gradient.data(), gradient.size(), 60, 5e-4f, 1e-2);
  testing::ExpectGradient(loss, inputs.data(), d_inputs.data(), inputs.size(), inputs.size(), 5e-4f, 1e-2);
}

struct LossCase {
  const char* name;
  bool is_object;
  bool random_background;
  float depth;
};

class CompositeGradientTest : public ::testing::TestWithParam<LossCase> {};

TEST_P(CompositeGradientTest, MatchesDifferencesOfTheWholeLoss) {
  constexpr int kSamples = 9;
  const LossWeights weights{.opacity_object = 0.5f,
                            .opacity_background = 0.5f,
                            .density = 0.01f,
                            .depth = 0.5f,
                            .depth_limit = 10.0f,
                            .random_background = GetParam().random_background};
  const RayTarget target{{0.9f, 0.2f, 0.4f}, {0.1f, 0.7f, 0.3f}, GetParam().depth, GetParam().is_object};
  float t[kSamples], length[kSamples], alpha[kSamples], density[kSamples], rgb[3][kSamples], weight[kSamples],
      behind[kSamples], raw[kSamples * kOutputs], d_raw[kSamples * kOutputs];
  for (int i = 0; i < kSamples; ++i) {
    t[i] = 2.0f + 0.1f * static_cast<float>(i);
    length[i] = 0.1f;
    for (int o = 0; o < kOutputs; ++o) raw[kOutputs * i + o] = Noise(4, static_cast<uint64_t>(kOutputs * i + o));
  }
  const RaySamples samples{kSamples, t, length, alpha, density, {rgb[0], rgb[1], rgb[2]}};
  const auto forward = [&] {
    for (int i = 0; i < kSamples; ++i) {
      for (int c = 0; c < 3; ++c) rgb[c][i] = plain::Sigmoid(raw[kOutputs * i + c]);
      density[i] = plain::Density(raw[kOutputs * i + 3]);
      alpha[i] = plain::StepOpacity(density[i], length[i]);
    }
    return plain::CompositeForward(samples, target, weights, weight, behind);
  };
  const RayResult result = forward();
  plain::CompositeBackward(samples, target, weights, result, weight, behind, d_raw);
  testing::ExpectGradient([&] { return forward().loss; }, raw, d_raw, kSamples * kOutputs, kSamples * kOutputs, 1e-2f,
                          5e-3);
}

INSTANTIATE_TEST_SUITE_P(Losses, CompositeGradientTest,
                         ::testing::Values(LossCase{"Object", true, false, -1}, LossCase{"Depth", true, false, 2.2f},
                                           LossCase{"RandomBackgroundObject", true, true, -1},
                                           LossCase{"Background", false, false, -1},
                                           LossCase{"RandomBackground", false, true, -1}),
                         [](const auto& info) { return info.param.name; });

// Two rays with three samples each, partners of one another.
TEST(CompositeTest, ContrastHasTheGradientOfBothRaysLosses) {
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
    testing::ExpectGradient(loss, chunk.raw.data(), d_raw.data(), chunk.size * kOutputs, chunk.size * kOutputs, 1e-2f,
                            5e-3);
  }
}

TEST(CompositeTest, OutlierDepthHasNoGradient) {
  const float t[1] = {2}, length[1] = {0.1f}, alpha[1] = {0.5f}, density[1] = {7}, color[1] = {0.5f};
  const RaySamples samples{1, t, length, alpha, density, {color, color, color}};
  const RayTarget near{{0.5f, 0.5f, 0.5f}, {}, 1.9f, true}, far{{0.5f, 0.5f, 0.5f}, {}, 1.0f, true};
  const LossWeights weights{.depth = 1.0f, .depth_limit = 0.2f};
  float weight[1], behind[1], d_near[4], d_far[4], d_none[4];
  const auto gradient = [&](const RayTarget& target, float* d) {
    const RayResult result = plain::CompositeForward(samples, target, weights, weight, behind);
    plain::CompositeBackward(samples, target, weights, result, weight, behind, d);
  };
  gradient(near, d_near);
  gradient(far, d_far);
  gradient(RayTarget{{0.5f, 0.5f, 0.5f}, {}, -1, true}, d_none);
  EXPECT_NE(d_near[3], d_none[3]);
  EXPECT_EQ(d_far[3], d_none[3]);
}

TEST(RandomTest, IsUniformAndDependsOnEveryCounter) {
  double sum = 0;
  for (uint64_t i = 0; i < 4096; ++i) sum += RandomUniform(1, 2, i);
  EXPECT_NEAR(sum / 4096, 0.5, 0.02);
  EXPECT_NE(RandomBits(1, 2, 3), RandomBits(2, 2, 3));
  EXPECT_NE(RandomBits(1, 2, 3), RandomBits(1, 3, 3));
  EXPECT_NE(RandomBits(1, 2, 3), RandomBits(1, 2, 4));
}

}  // namespace
}  // namespace romap::nerf
