#include "client/cli/cuboid_outline.h"

#include <gtest/gtest.h>

namespace romap::cli::cuboid_outline_test {

const CameraModel kCamera{
    .width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500, .cx_px = 320, .cy_px = 240, .distortion = {}};

Cuboid At(double x, double y, double z) {
  Cuboid cuboid;
  cuboid.T_world_object = SE3<World, Object>(Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, y, z));
  cuboid.half_extents = Eigen::Vector3d(0.1, 0.2, 0.5);
  return cuboid;
}

TEST(CuboidOutlineTest, IsTheBoundingBoxOfTheNearFace) {
  const auto outline = CuboidOutline(At(0, 0, 2.5), kCamera, SE3<World, Camera>());
  ASSERT_TRUE(outline.has_value());
  EXPECT_NEAR(outline->x, 320 - 500 * 0.1 / 2, 1e-9);
  EXPECT_NEAR(outline->width, 2 * 500 * 0.1 / 2, 1e-9);
  EXPECT_NEAR(outline->height, 2 * 500 * 0.2 / 2, 1e-9);
}

TEST(CuboidOutlineTest, IsEmptyBehindTheCameraAndAcrossTheImageBorder) {
  EXPECT_FALSE(CuboidOutline(At(0, 0, -2), kCamera, SE3<World, Camera>()));
  EXPECT_FALSE(CuboidOutline(At(0, 0, 0.2), kCamera, SE3<World, Camera>()));
  EXPECT_FALSE(CuboidOutline(At(1.3, 0, 2.5), kCamera, SE3<World, Camera>()));
}

}  // namespace romap::cli::cuboid_outline_test
