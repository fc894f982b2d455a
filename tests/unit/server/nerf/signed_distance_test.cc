// Signed-distance fields: their opacities, the losses on their shape, and the kernels of both.
#include "server/nerf/math/signed_distance.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <array>
#include <cmath>
#include <vector>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/math/random.h"
#include "tests/unit/server/nerf/gradient_check.h"

namespace romap::nerf {
namespace {

using testing::ExpectGradient;

constexpr float kSharpness = 30;

float Noise(uint64_t stream, uint64_t i) { return 2.0f * RandomUniform(13, stream, i) - 1.0f; }

float RawAt(float distance) { return -distance / kDistancePerRaw; }

// Samples of rays one after the other, `per_ray` each.
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

TEST(SignedDistanceTest, LightFallsWhereARayEntersAndNowhereElse) {
  const std::array<float, 6> distances = {0.5f, 0.05f, -0.05f, -0.4f, 0.1f, 0.5f};  // in and out again
  Rays rays(1, 6);
  for (size_t i = 0; i < distances.size(); ++i) rays.chunk.raw[kOutputs * i + 3] = RawAt(distances[i]);
  rays.Opacities(PlainKernels());
  const auto light = [](float d) { return 1 / (1 + std::exp(-kSharpness * d)); };
  EXPECT_NEAR(rays.chunk.alpha[0], 1 - light(0.5f), 1e-6) << "it comes from outside";
  EXPECT_NEAR(rays.chunk.alpha[1], 1 - light(0.05f) / light(0.5f), 1e-6);
  EXPECT_NEAR(rays.chunk.alpha[2], 1 - light(-0.05f) / light(0.05f), 1e-6);
  EXPECT_GT(rays.chunk.alpha[2], 0.7f) << "the surface lies on this stretch";
  EXPECT_EQ(rays.chunk.alpha[4], 0) << "what is left behind takes nothing away";
  EXPECT_EQ(rays.chunk.alpha[5], 0);
}

TEST(SignedDistanceTest, RaysKnowNothingOfTheirNeighbours) {
  Rays rays(2, 3);
  for (size_t i = 0; i < 6; ++i) rays.chunk.raw[kOutputs * i + 3] = RawAt(i < 3 ? -0.5f : 0.0f);
  rays.Opacities(PlainKernels());
  EXPECT_NEAR(rays.chunk.alpha[3], 0.5f, 1e-6) << "the first sample of a ray has no sample before it";
}

TEST(SignedDistanceTest, ExtremeDistancesStayNumbers) {
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

TEST(SignedDistanceTest, GradientMatchesDifferencesOfTheWholeLoss) {
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
    testing::ExpectGradient(loss, c.raw.data(), d_raw.data(), count, count, 1e-3f, 1e-2);
  }
}

TEST(SignedDistanceTest, EveryInstructionSetAgreesWithThePlainForm) {
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

// ------------------------------------------------------------------------------------------------------------- shape

constexpr float kSpacing = 0.02f;

// Values at the stencil's points about `center`.
std::array<float, kStencilPoints> Around(const std::array<float, 3>& center,
                                         const std::function<float(float, float, float)>& f) {
  std::array<float, kStencilPoints> values;
  for (int p = 0; p < kStencilPoints; ++p) {
    values[static_cast<size_t>(p)] =
        f(center[0] + kSpacing * plain::StencilOffset(p, 0), center[1] + kSpacing * plain::StencilOffset(p, 1),
          center[2] + kSpacing * plain::StencilOffset(p, 2));
  }
  return values;
}

float Loss(const ShapeWeights& weights, const std::array<float, kStencilPoints>& distance) {
  std::array<float, kStencilPoints> d;
  return plain::ShapeLoss(weights, kSpacing, distance.data(), d.data());
}

TEST(ShapeLossTest, PlanesOfSlopeOneCostNothing) {
  const auto plane = [](float slope) {
    return Around({0.3f, 0.4f, 0.5f},
                  [slope](float x, float y, float z) { return slope * (0.48f * x + 0.6f * y - 0.64f * z); });
  };
  EXPECT_NEAR(Loss({1, 0}, plane(1)), 0, 1e-5);
  EXPECT_NEAR(Loss({1, 0}, plane(3)), 4, 1e-3);
  EXPECT_NEAR(Loss({0, 1}, plane(3)), 0, 1e-6);
}

TEST(ShapeLossTest, CurvatureIsTheTraceOfTheHessian) {
  const auto bowl = Around({0, 0, 0}, [](float x, float y, float z) { return 2 * x * x + 3 * y * y - z * z + x * y; });
  // Trace 4 + 6 - 2, times the spacing, squared.
  EXPECT_NEAR(Loss({0, 1}, bowl), std::pow(8 * kSpacing, 2), 1e-5);
}

TEST(ShapeLossTest, GradientMatchesDifferences) {
  for (const ShapeWeights weights : {ShapeWeights{1, 0}, ShapeWeights{0, 1}, ShapeWeights{0.3f, 0.2f}}) {
    std::array<float, kStencilPoints> distance, d;
    for (size_t i = 0; i < distance.size(); ++i) distance[i] = 0.02f * Noise(7, i);
    plain::ShapeLoss(weights, kSpacing, distance.data(), d.data());
    testing::ExpectGradient([&] { return Loss(weights, distance); }, distance.data(), d.data(), kStencilPoints,
                            kStencilPoints, 1e-4f, 1e-2);
  }
}

}  // namespace
}  // namespace romap::nerf
