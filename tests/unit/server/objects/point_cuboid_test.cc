#include "server/objects/point_cuboid.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <vector>

namespace romap::objects::point_cuboid_test {

// Points on the faces of a box with half extents (3, 1, 0.5), rotated by `yaw_rad`, around (10, 20, 30).
std::vector<Eigen::Vector3d> BoxPoints(double yaw_rad) {
  const Eigen::AngleAxisd yaw(yaw_rad, Eigen::Vector3d::UnitZ());
  std::vector<Eigen::Vector3d> points;
  for (int i = -6; i <= 6; ++i) {
    for (int j = -2; j <= 2; ++j) {
      for (double z : {-0.5, 0.5}) {
        points.push_back(Eigen::Vector3d(10, 20, 30) + yaw * Eigen::Vector3d(0.5 * i, 0.5 * j, z));
      }
    }
  }
  return points;
}

TEST(CuboidOfPoints, BoundsThePointsAlongTheirMainAxis) {
  const auto cuboid = CuboidOfPoints({}, BoxPoints(0.4), std::nullopt);
  ASSERT_TRUE(cuboid);
  EXPECT_NEAR((cuboid->half_extents - Eigen::Vector3d(3, 1, 0.5)).norm(), 0, 1e-6);
  EXPECT_NEAR((cuboid->T_world_object.translation() - Eigen::Vector3d(10, 20, 30)).norm(), 0, 1e-6);
  const Eigen::Vector3d x = cuboid->T_world_object.RotationMatrix().col(0);
  EXPECT_NEAR(std::abs(x.dot(Eigen::Vector3d(std::cos(0.4), std::sin(0.4), 0))), 1, 1e-9);
}

TEST(CuboidOfPoints, HasTheYawOfTheEdgesIfGiven) {
  const auto cuboid = CuboidOfPoints({}, BoxPoints(0.4), 0.0);
  ASSERT_TRUE(cuboid);
  EXPECT_NEAR(cuboid->half_extents.x(), 3 * std::cos(0.4) + std::sin(0.4), 1e-9);
}

TEST(CuboidOfPoints, ConvertsFromGridToWorld) {
  HullRegion region;
  region.R_world_grid = Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitX()).toRotationMatrix();
  region.center_world = {1, 2, 3};
  const auto cuboid = CuboidOfPoints(region, BoxPoints(0), 0.0);
  ASSERT_TRUE(cuboid);
  EXPECT_NEAR((cuboid->T_world_object.translation() - region.ToWorld({10, 20, 30})).norm(), 0, 1e-9);
  EXPECT_NEAR((cuboid->T_world_object.RotationMatrix().col(2) - region.R_world_grid.col(2)).norm(), 0, 1e-9);
}

TEST(CuboidOfPoints, ReturnsNothingWithoutVolume) {
  EXPECT_FALSE(CuboidOfPoints({}, {}, std::nullopt));
  const std::vector<Eigen::Vector3d> flat = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
  EXPECT_FALSE(CuboidOfPoints({}, flat, std::nullopt));
  std::vector<Eigen::Vector3d> broken = BoxPoints(0);
  broken[3].x() = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(CuboidOfPoints({}, broken, 0.0));
}

}  // namespace romap::objects::point_cuboid_test
