#include "server/nerf/math/signed_distance.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

#include "server/nerf/math/random.h"
#include "tests/unit/server/nerf/math/gradient_check.h"

namespace romap::nerf::signed_distance_test {

float Noise(uint64_t stream, uint64_t i) { return 2.0f * RandomUniform(13, stream, i) - 1.0f; }

constexpr float kSpacing = 0.02f;

// Values of f at the points of the stencil around `center`.
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

TEST(ShapeLossTest, PlanesOfSlopeOneHaveNoLoss) {
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

TEST(ShapeLossTest, GradientMatchesFiniteDifferences) {
  for (const ShapeWeights weights : {ShapeWeights{1, 0}, ShapeWeights{0, 1}, ShapeWeights{0.3f, 0.2f}}) {
    std::array<float, kStencilPoints> distance, d;
    for (size_t i = 0; i < distance.size(); ++i) distance[i] = 0.02f * Noise(7, i);
    plain::ShapeLoss(weights, kSpacing, distance.data(), d.data());
    testing_support::ExpectGradient([&] { return Loss(weights, distance); }, distance.data(), d.data(), kStencilPoints,
                                    kStencilPoints, 1e-4f, 1e-2);
  }
}

}  // namespace romap::nerf::signed_distance_test
