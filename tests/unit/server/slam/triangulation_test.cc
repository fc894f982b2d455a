#include "server/slam/triangulation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

namespace romap::slam::triangulation_test {

ObservedRay RayFrom(const Eigen::Vector3d& center_world, const Eigen::Vector3d& p_world, double sigma_rad = 1e-3) {
  return {.center_world = center_world,
          .bearing_world = (p_world - center_world).normalized(),
          .bearing_sigma_rad = sigma_rad};
}

TEST(IntersectRays, FindsTheIntersection) {
  const Eigen::Vector3d p_world(0.3, -0.2, 4);
  const auto found = IntersectRays(RayFrom({0, 0, 0}, p_world), RayFrom({0.5, 0.1, 0}, p_world));
  ASSERT_TRUE(found);
  EXPECT_LT((*found - p_world).norm(), 1e-9);
}

TEST(IntersectRays, ReturnsNothingForParallelOrDivergingRays) {
  const ObservedRay a{.center_world = {0, 0, 0}, .bearing_world = Eigen::Vector3d::UnitZ()};
  const ObservedRay parallel{.center_world = {1, 0, 0}, .bearing_world = Eigen::Vector3d::UnitZ()};
  const ObservedRay diverging{.center_world = {1, 0, 0}, .bearing_world = Eigen::Vector3d(0.2, 0, 1).normalized()};
  EXPECT_FALSE(IntersectRays(a, parallel));
  EXPECT_FALSE(IntersectRays(a, diverging));
}

TEST(BearingChi2, IsOneAtOneSigmaAndInfiniteBehind) {
  const ObservedRay ray{
      .center_world = {0, 0, 0}, .bearing_world = Eigen::Vector3d::UnitZ(), .bearing_sigma_rad = 0.01};
  EXPECT_NEAR(BearingChi2(ray, {0.02, 0, 2}), 1, 1e-9);
  EXPECT_TRUE(std::isinf(BearingChi2(ray, {0, 0, -2})));
}

TEST(Agrees, ChecksTheRangeIfKnown) {
  ObservedRay ray{.center_world = {0, 0, 0}, .bearing_world = Eigen::Vector3d::UnitZ(), .bearing_sigma_rad = 0.01};
  EXPECT_TRUE(Agrees(ray, {0, 0, 5}));
  EXPECT_FALSE(Agrees(ray, {1, 0, 5}));
  ray.range_mu = 2;
  ray.range_sigma_mu = 0.1;
  EXPECT_FALSE(Agrees(ray, {0, 0, 5}));
  EXPECT_TRUE(Agrees(ray, {0, 0, 2.2}));
}

TEST(Parallax, IsTheAngleBetweenTheRays) {
  const Eigen::Vector3d p_world(0, 0, 1);
  const ObservedRay a = RayFrom({0, 0, 0}, p_world);
  const ObservedRay b = RayFrom({1, 0, 0}, p_world);
  EXPECT_NEAR(Parallax_rad(a, b, p_world), std::atan(1.0), 1e-12);
}

TEST(RefinePoint, ManyNoisyRaysAreMoreAccurateThanTwo) {
  const Eigen::Vector3d p_world(0.1, 0.2, 3);
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 1e-3);
  double error_of_two = 0;
  double error_of_all = 0;
  for (int trial = 0; trial < 50; ++trial) {
    std::vector<ObservedRay> rays;
    for (int i = 0; i < 10; ++i) {
      ObservedRay ray = RayFrom({0.1 * i, 0.02 * i, 0}, p_world);
      ray.bearing_world += Eigen::Vector3d(noise(random), noise(random), 0);
      ray.bearing_world.normalize();
      rays.push_back(ray);
    }
    const auto start = IntersectRays(rays[0], rays[3]);
    ASSERT_TRUE(start);
    error_of_two += (*start - p_world).norm();
    error_of_all += (RefinePoint(rays, *start) - p_world).norm();
  }
  EXPECT_LT(error_of_all, 0.4 * error_of_two);
  EXPECT_LT(error_of_all / 50, 0.01);
}

TEST(RefinePoint, IsRobustToOneOutlier) {
  const Eigen::Vector3d p_world(0, 0, 2);
  std::vector<ObservedRay> rays;
  for (int i = 0; i < 6; ++i) rays.push_back(RayFrom({0.2 * i, 0, 0}, p_world));
  rays.push_back(RayFrom({0.5, 0.5, 0}, p_world + Eigen::Vector3d(0.3, 0.3, 0)));
  EXPECT_LT((RefinePoint(rays, p_world) - p_world).norm(), 0.01);
}

TEST(RefinePoint, RangeDeterminesDepthOfASingleRay) {
  ObservedRay ray{.center_world = {0, 0, 0}, .bearing_world = Eigen::Vector3d::UnitZ(), .bearing_sigma_rad = 1e-3};
  ray.range_mu = 2;
  ray.range_sigma_mu = 0.02;
  EXPECT_LT((RefinePoint({ray}, {0.01, 0, 2.02}) - Eigen::Vector3d(0, 0, 2)).norm(), 1e-4);
}

}  // namespace romap::slam::triangulation_test
