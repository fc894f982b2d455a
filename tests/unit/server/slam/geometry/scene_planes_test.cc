#include "server/slam/geometry/scene_planes.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "common/angles.h"

namespace romap::slam::scene_planes_test {

class ScenePlanesTest : public ::testing::Test {
 protected:
  double Uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }

  // Points on a rectangle of 3 m by 2 m; the errors are 1 cm.
  void AddPlane(const Eigen::Vector3d& corner, const Eigen::Vector3d& side, const Eigen::Vector3d& other, int count) {
    std::normal_distribution<double> noise(0, 0.01);
    for (int i = 0; i < count; ++i) {
      const Eigen::Vector3d error(noise(random_), noise(random_), noise(random_));
      points_.push_back(
          {.position_world = corner + 3 * Uniform(0, 1) * side + 2 * Uniform(0, 1) * other + error, .sigma_mu = 0.01});
    }
  }

  void AddCloud(int count) {
    for (int i = 0; i < count; ++i) {
      points_.push_back({.position_world = {Uniform(0, 3), Uniform(0, 3), Uniform(0, 2)}, .sigma_mu = 0.01});
    }
  }

  std::vector<SupportPoint> points_;
  std::mt19937_64 random_{1};
};

TEST_F(ScenePlanesTest, FindsFloorAndWallsAmongOtherPoints) {
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX(), y = Eigen::Vector3d::UnitY(), z = Eigen::Vector3d::UnitZ();
  AddPlane({0, 0, 0}, x, y, 150);
  AddPlane({0, 0, 0}, x, z, 110);
  AddPlane({0, 0, 0}, y, z, 80);
  AddCloud(100);
  const std::vector<PlaneFit> planes = FindScenePlanes(points_, 1);
  ASSERT_EQ(planes.size(), 3u);
  const Eigen::Vector3d normals[] = {z, y, x};
  for (size_t i = 0; i < 3; ++i) {
    SCOPED_TRACE(i);
    EXPECT_GT(std::abs(planes[i].plane.normal.dot(normals[i])), std::cos(1 * kRadPerDeg));
    EXPECT_LT(planes[i].sigma_rad, 2.2 * kRadPerDeg);
  }
}

TEST_F(ScenePlanesTest, FindsNoPlaneInACloud) {
  AddCloud(400);
  EXPECT_TRUE(FindScenePlanes(points_, 1).empty());
}

TEST_F(ScenePlanesTest, IgnoresFewAndInvalidPoints) {
  EXPECT_TRUE(FindScenePlanes({}, 1).empty());
  AddPlane({0, 0, 0}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 20);
  EXPECT_TRUE(FindScenePlanes(points_, 1).empty());
  AddPlane({0, 0, 0}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 80);
  for (size_t i = 0; i < points_.size(); i += 10) points_[i].position_world.x() = NAN;
  EXPECT_EQ(FindScenePlanes(points_, 1).size(), 1u);
}

}  // namespace romap::slam::scene_planes_test
