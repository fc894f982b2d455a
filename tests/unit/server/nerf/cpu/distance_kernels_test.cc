// The kernels of signed-distance fields: opacities and their adjoint.

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <array>
#include <cmath>
#include <vector>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/math/random.h"
#include "tests/unit/server/nerf/math/gradient_check.h"

namespace romap::nerf::distance_kernels_test {

using testing_support::ExpectGradient;

constexpr float kSharpness = 30;

float Noise(uint64_t stream, uint64_t i) { return 2.0f * RandomUniform(13, stream, i) - 1.0f; }

float RawAt(float distance) { return -distance / kDistancePerRaw; }

// Consecutive samples of rays, `per_ray` each.
struct Rays {
  Rays(int rays, int per_ray) : chunk(rays * per_ray, 16, 16) {
    chunk.size = rays * per_ray;
    for (int r = 0; r < rays; ++r) spans.push_back({r * per_ray, per_ray});
    for (size_t i = 0; i < static_cast<size_t>(chunk.size); ++i) chunk.t[i] = 2.0f + 0.1f * static_cast<float>(i);
  }
  void Opacities(const KernelTable& kernels) {
    kernels.activate(chunk, 0);
    kernels.distance_opacity(spans.data(), static_cast<int>(spans.size()), kSharpness, chunk);
  }

  SampleChunk chunk;
  std::vector<RaySpan> spans;
};

TEST(DistanceKernelsTest, OpacityIsPositiveOnlyWhereARayEnters) {
  const std::array<float, 6> distances = {0.5f, 0.05f, -0.05f, -0.4f, 0.1f, 0.5f};  // into the surface and out again
  Rays rays(1, 6);
  for (size_t i = 0; i < distances.size(); ++i) rays.chunk.raw[kOutputs * i + 3] = RawAt(distances[i]);
  rays.Opacities(PlainKernels());
  const auto transmittance = [](float d) { return 1 / (1 + std::exp(-kSharpness * d)); };
  EXPECT_NEAR(rays.chunk.alpha[0], 1 - transmittance(0.5f), 1e-6) << "rays start outside";
  EXPECT_NEAR(rays.chunk.alpha[1], 1 - transmittance(0.05f) / transmittance(0.5f), 1e-6);
  EXPECT_NEAR(rays.chunk.alpha[2], 1 - transmittance(-0.05f) / transmittance(0.05f), 1e-6);
  EXPECT_GT(rays.chunk.alpha[2], 0.7f) << "the surface lies in front of this sample";
  EXPECT_EQ(rays.chunk.alpha[4], 0) << "leaving a surface does not attenuate";
  EXPECT_EQ(rays.chunk.alpha[5], 0);
}

TEST(DistanceKernelsTest, RaysAreIndependent) {
  Rays rays(2, 3);
  for (size_t i = 0; i < 6; ++i) rays.chunk.raw[kOutputs * i + 3] = RawAt(i < 3 ? -0.5f : 0.0f);
  rays.Opacities(PlainKernels());
  EXPECT_NEAR(rays.chunk.alpha[3], 0.5f, 1e-6) << "the first sample of a ray has no predecessor";
}

TEST(DistanceKernelsTest, ExtremeDistancesStayFinite) {
  Rays rays(1, 4);
  const std::array<float, 4> raw = {-1e30f, 1e30f, -1e30f, 1e30f};
  for (size_t i = 0; i < raw.size(); ++i) rays.chunk.raw[kOutputs * i + 3] = raw[i];
  rays.Opacities(PlainKernels());
  for (size_t i = 0; i < raw.size(); ++i) rays.chunk.d_raw[kOutputs * i + 3] = 1.0f;
  PlainKernels().distance_backward(rays.spans.data(), 1, kSharpness, rays.chunk);
  for (size_t i = 0; i < raw.size(); ++i) {
    EXPECT_TRUE(rays.chunk.alpha[i] >= 0 && rays.chunk.alpha[i] <= 1);
    EXPECT_TRUE(std::isfinite(rays.chunk.d_raw[kOutputs * i + 3]));
  }
}

TEST(DistanceKernelsTest, GradientMatchesFiniteDifferencesOfTheLoss) {
  for (const bool is_object : {true, false}) {
    Rays rays(2, 7);
    SampleChunk& c = rays.chunk;
    for (size_t i = 0; i < static_cast<size_t>(c.size * kOutputs); ++i) c.raw[i] = 0.7f * Noise(4, i);
    std::array<Ray, 2> targets{};
    targets[0].target = {{0.9f, 0.2f, 0.4f}, {}, is_object ? 2.3f : -1.0f, is_object, is_object ? 1 : 0};
    targets[1].target = {{0.3f, 0.6f, 0.1f}, {}, -1.0f, is_object, is_object ? -1 : 0};
    const LossWeights weights{
        .opacity_object = 0.5f, .opacity_background = 0.5f, .depth = 0.5f, .contrast = 2.0f, .depth_limit = 10.0f};
    std::array<RayResult, 2> results{};
    const auto loss = [&] {
      rays.Opacities(PlainKernels());
      PlainKernels().composite(targets.data(), rays.spans.data(), 2, weights, c, results.data());
      return static_cast<double>(results[0].loss) + results[1].loss;
    };
    loss();
    PlainKernels().distance_backward(rays.spans.data(), 2, kSharpness, c);
    const std::vector<float> d_raw(c.d_raw.data(), c.d_raw.data() + c.size * kOutputs);
    const auto count = static_cast<size_t>(c.size * kOutputs);
    testing_support::ExpectGradient(loss, c.raw.data(), d_raw.data(), count, count, 1e-3f, 1e-2);
  }
}

TEST(DistanceKernelsTest, EveryInstructionSetEqualsThePlainForm) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    Rays want(5, 7), got(5, 7);
    for (size_t i = 0; i < static_cast<size_t>(want.chunk.size * kOutputs); ++i) {
      want.chunk.raw[i] = got.chunk.raw[i] = 2 * Noise(5, i);
      want.chunk.d_raw[i] = got.chunk.d_raw[i] = Noise(6, i);
    }
    const auto run = [](const KernelTable& kernels, Rays& rays) {
      rays.Opacities(kernels);
      kernels.distance_backward(rays.spans.data(), 5, kSharpness, rays.chunk);
    };
    run(PlainKernels(), want);
    run(SimdKernels(), got);
    for (size_t i = 0; i < static_cast<size_t>(want.chunk.size); ++i) {
      EXPECT_NEAR(got.chunk.alpha[i], want.chunk.alpha[i], 1e-5) << SimdKernels().name << ", sample " << i;
      const float d = want.chunk.d_raw[kOutputs * i + 3];
      EXPECT_NEAR(got.chunk.d_raw[kOutputs * i + 3], d, 1e-4f * (1 + std::fabs(d)));
    }
  }
  hwy::SetSupportedTargetsForTest(0);
}

}  // namespace romap::nerf::distance_kernels_test
