#include "server/slam/triangulation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

namespace romap::slam {
namespace {

Sight SightFrom(const Eigen::Vector3d& center_world, const Eigen::Vector3d& p_world, double sigma_rad = 1e-3) {
  return {.center_world = center_world,
          .bearing_world = (p_world - center_world).normalized(),
          .bearing_sigma_rad = sigma_rad};
}

TEST(IntersectRays, MeetsInThePoint) {
  const Eigen::Vector3d p_world(0.3, -0.2, 4);
  const auto found = IntersectRays(SightFrom({0, 0, 0}, p_world), SightFrom({0.5, 0.1, 0}, p_world));
  ASSERT_TRUE(found);
  EXPECT_LT((*found - p_world).norm(), 1e-9);
}

TEST(IntersectRays, HasNoAnswerForParallelOrDivergingRays) {
  const Sight a{.center_world = {0, 0, 0}, .bearing_world = Eigen::Vector3d::UnitZ()};
  const Sight parallel{.center_world = {1, 0, 0}, .bearing_world = Eigen::Vector3d::UnitZ()};
  const Sight diverging{.center_world = {1, 0, 0}, .bearing_world = Eigen::Vector3d(0.2, 0, 1).normalized()};
  EXPECT_FALSE(IntersectRays(a, parallel));
  EXPECT_FALSE(IntersectRays(a, diverging));
}

TEST(BearingChi2, IsOneAtOneSigmaAndInfiniteBehind) {
  const Sight sight{.center_world = {0, 0, 0}, .bearing_world = Eigen::Vector3d::UnitZ(), .bearing_sigma_rad = 0.01};
  EXPECT_NEAR(BearingChi2(sight, {0.02, 0, 2}), 1, 1e-9);
  EXPECT_TRUE(std::isinf(BearingChi2(sight, {0, 0, -2})));
}

TEST(Agrees, AsksTheRangeTooWhereThereIsOne) {
  Sight sight{.center_world = {0, 0, 0}, .bearing_world = Eigen::Vector3d::UnitZ(), .bearing_sigma_rad = 0.01};
  EXPECT_TRUE(Agrees(sight, {0, 0, 5}));
  EXPECT_FALSE(Agrees(sight, {1, 0, 5}));
  sight.range_mu = 2;
  sight.range_sigma_mu = 0.1;
  EXPECT_FALSE(Agrees(sight, {0, 0, 5}));
  EXPECT_TRUE(Agrees(sight, {0, 0, 2.2}));
}

TEST(Parallax, IsTheAngleBetweenTheRays) {
  const Eigen::Vector3d p_world(0, 0, 1);
  const Sight a = SightFrom({0, 0, 0}, p_world);
  const Sight b = SightFrom({1, 0, 0}, p_world);
  const Sight c = SightFrom({0.1, 0, 0}, p_world);
  EXPECT_NEAR(Parallax_rad(a, b, p_world), std::atan(1.0), 1e-12);
  EXPECT_NEAR(MaxParallax_rad({a, c, b}, p_world), std::atan(1.0), 1e-12);
}

TEST(RefinePoint, ManyNoisySightsPlaceThePointBetterThanTwo) {
  const Eigen::Vector3d p_world(0.1, 0.2, 3);
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 1e-3);
  double error_of_two = 0;
  double error_of_all = 0;
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<Sight> sights;
    for (int i = 0; i < 10; ++i) {
      Sight sight = SightFrom({0.1 * i, 0.02 * i, 0}, p_world);
      sight.bearing_world += Eigen::Vector3d(noise(random), noise(random), 0);
      sight.bearing_world.normalize();
      sights.push_back(sight);
    }
    const auto start = IntersectRays(sights[0], sights[3]);
    ASSERT_TRUE(start);
    error_of_two += (*start - p_world).norm();
    error_of_all += (RefinePoint(sights, *start) - p_world).norm();
  }
  EXPECT_LT(error_of_all, 0.4 * error_of_two);
  EXPECT_LT(error_of_all / 50, 0.01);
}

TEST(RefinePoint, OneWildSightHardlyMovesIt) {
  const Eigen::Vector3d p_world(0, 0, 2);
  std::vector<Sight> sights;
  for (int i = 0; i < 6; ++i) sights.push_back(SightFrom({0.2 * i, 0, 0}, p_world));
  sights.push_back(SightFrom({0.5, 0.5, 0}, p_world + Eigen::Vector3d(0.3, 0.3, 0)));
  EXPECT_LT((RefinePoint(sights, p_world) - p_world).norm(), 0.01);
}

TEST(RefinePoint, ARangeFixesWhatASingleRayLeavesOpen) {
  Sight sight{.center_world = {0, 0, 0}, .bearing_world = Eigen::Vector3d::UnitZ(), .bearing_sigma_rad = 1e-3};
  sight.range_mu = 2;
  sight.range_sigma_mu = 0.02;
  EXPECT_LT((RefinePoint({sight}, {0.01, 0, 2.02}) - Eigen::Vector3d(0, 0, 2)).norm(), 1e-4);
}

}  // namespace
}  // namespace romap::slam
