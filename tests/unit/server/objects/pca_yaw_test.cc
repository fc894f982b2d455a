#include "server/objects/pca_yaw.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace romap::objects::pca_yaw_test {

// Points uniformly distributed in an upright cuboid.
std::vector<Eigen::Vector3d> Fill(const Eigen::Vector3d& half_extents, double yaw_rad, int count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  const Eigen::AngleAxisd turn(yaw_rad, Eigen::Vector3d::UnitZ());
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < count; ++i) {
    const double x = unit(random);
    const double y = unit(random);
    const Eigen::Vector3d p = Eigen::Vector3d(x, y, unit(random)).cwiseProduct(half_extents);
    points.push_back(turn * p + Eigen::Vector3d(3, -2, 1));
  }
  return points;
}

TEST(PcaYawTest, FindsTheLongAxis) {
  for (const double yaw_rad : {-1.3, -0.5, 0.0, 0.4, 1.5}) {
    const auto yaw = PcaYaw(Fill({0.4, 0.1, 1.0}, yaw_rad, 400));
    ASSERT_TRUE(yaw.has_value());
    EXPECT_NEAR(std::remainder(*yaw - yaw_rad, std::numbers::pi), 0, 0.05);
    EXPECT_LE(std::abs(*yaw), std::numbers::pi / 2 + 1e-9);
  }
}

TEST(PcaYawTest, IsRobustToOutliers) {
  std::vector<Eigen::Vector3d> points = Fill({0.4, 0.1, 0.1}, 0.3, 200);
  for (int i = 0; i < 6; ++i) points.emplace_back(3 - 2.0, -2 + 2.0 + 0.1 * i, 1);
  const auto yaw = PcaYaw(points);
  ASSERT_TRUE(yaw.has_value());
  EXPECT_NEAR(*yaw, 0.3, 0.1);
}

TEST(PcaYawTest, ReturnsNothingWithoutALongAxis) {
  EXPECT_FALSE(PcaYaw(Fill({0.3, 0.3, 0.1}, 0.3, 2000)).has_value());
  EXPECT_FALSE(PcaYaw(Fill({0.3, 0.1, 0.1}, 0.3, 7)).has_value());
  EXPECT_FALSE(PcaYaw(std::vector<Eigen::Vector3d>(20, Eigen::Vector3d::Ones())).has_value());
}

TEST(PcaYawTest, AcceptsPointsOnALine) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 20; ++i) points.emplace_back(0.1 * i, 0.1 * i, 0);
  const auto yaw = PcaYaw(points);
  ASSERT_TRUE(yaw.has_value());
  EXPECT_NEAR(*yaw, std::numbers::pi / 4, 1e-6);
}

}  // namespace romap::objects::pca_yaw_test
