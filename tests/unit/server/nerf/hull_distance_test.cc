#include "server/nerf/hull_distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/nerf/math/types.h"

namespace romap::nerf::hull_distance_test {

constexpr int kSide = kOccupancyResolution;

Eigen::Vector3f CenterOf(size_t cell, const Eigen::Vector3f& extent) {
  const Eigen::Vector3f index(static_cast<float>(cell % kSide), static_cast<float>(cell / kSide % kSide),
                              static_cast<float>(cell / kSide / kSide));
  return (index.array() + 0.5f).matrix().cwiseProduct(extent / kSide);
}

TEST(HullDistanceTest, MeasuresTheDistanceToABall) {
  const Eigen::Vector3f extent(1, 0.8f, 0.6f);
  constexpr float kRadius = 0.2f;
  std::vector<uint8_t> ball(static_cast<size_t>(kSide) * kSide * kSide);
  const auto distance_at = [&](size_t cell) { return (CenterOf(cell, extent) - extent / 2).norm() - kRadius; };
  for (size_t i = 0; i < ball.size(); ++i) ball[i] = distance_at(i) < 0 ? 1 : 0;
  const std::vector<float> distance = DistanceToBorder(ball, extent);
  const float cell = (extent / kSide).maxCoeff(), reach = 9 * (extent / kSide).minCoeff();
  float largest_error = 0;
  for (size_t i = 0; i < ball.size(); ++i) {
    EXPECT_EQ(distance[i] < 0, ball[i] != 0);
    const float truth = distance_at(i);
    if (std::fabs(truth) < reach) largest_error = std::max(largest_error, std::fabs(distance[i] - truth));
  }
  EXPECT_LT(largest_error, cell);
  EXPECT_GT(distance[0], reach) << "clamped";
}

TEST(HullDistanceTest, TheBorderIsBetweenTheCells) {
  std::vector<uint8_t> half(static_cast<size_t>(kSide) * kSide * kSide);
  for (size_t i = 0; i < half.size(); ++i) half[i] = i / kSide % kSide < 30 ? 1 : 0;  // y below 30 cells
  const std::vector<float> distance = DistanceToBorder(half, {1, 1, 1});
  EXPECT_NEAR(distance[29 * kSide + 5], -0.5f / kSide, 1e-6);
  EXPECT_NEAR(distance[30 * kSide + 5], 0.5f / kSide, 1e-6);
  EXPECT_NEAR(distance[34 * kSide + 5], 4.5f / kSide, 1e-6);
}

TEST(HullDistanceTest, WithoutABorderAllDistancesAreLarge) {
  for (const uint8_t all : {0, 1}) {
    const std::vector<float> distance = DistanceToBorder(std::vector<uint8_t>(kSide * kSide * kSide, all), {1, 1, 1});
    for (const float d : distance) ASSERT_GT(all != 0 ? -d : d, 5.0f / kSide);
  }
}

}  // namespace romap::nerf::hull_distance_test
