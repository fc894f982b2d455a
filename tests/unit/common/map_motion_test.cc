#include "common/map_motion.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

namespace romap::map_motion_test {

Sim3<World, World> SomeCorrection() {
  return {1.5, Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized())), {4, -5, 6}};
}

TEST(MapMotionTest, CuboidCornersMoveWithTheSpace) {
  const Cuboid cuboid{{Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ())), Eigen::Vector3d(1, 2, 3)},
                      {0.1, 0.2, 0.3},
                      0.5};
  const Cuboid moved = Moved(SomeCorrection(), cuboid);
  for (const Eigen::Vector3d& sign : {Eigen::Vector3d(1, 1, 1), Eigen::Vector3d(-1, 1, -1)}) {
    const Eigen::Vector3d corner = cuboid.T_world_object * sign.cwiseProduct(cuboid.half_extents);
    const Eigen::Vector3d moved_corner = moved.T_world_object * sign.cwiseProduct(moved.half_extents);
    EXPECT_TRUE(moved_corner.isApprox(SomeCorrection() * corner, 1e-12));
  }
  EXPECT_EQ(moved.confidence, 0.5);
}

TEST(MapMotionTest, MovedViewProjectsMovedPointsToTheSamePixels) {
  ObjectView view;
  view.camera = {64, 48, 50, 50, 31.5, 23.5, {}};
  view.T_world_camera = {Eigen::Quaterniond(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX())),
                         Eigen::Vector3d(1, 0, 0)};
  view.sparse_depth = {{40, 20, 2.0f}};
  view.depth_mu = cv::Mat(2, 2, CV_32FC1, cv::Scalar(2));
  const ObjectView moved = Moved(SomeCorrection(), view);
  const Eigen::Vector3d p_world = view.T_world_camera * (2.0 * view.camera.Unproject(40, 20));
  const Eigen::Vector3d p_camera = moved.T_world_camera.Inverse() * (SomeCorrection() * p_world);
  EXPECT_TRUE(moved.camera.Project(p_camera).isApprox(Eigen::Vector2d(40, 20), 1e-9));
  EXPECT_NEAR(p_camera.z(), moved.sparse_depth[0].z(), 1e-6);
  EXPECT_EQ(moved.depth_mu.at<float>(1, 1), 3.0f);
  EXPECT_EQ(view.depth_mu.at<float>(1, 1), 2.0f) << "the pixels of the original view are shared and must not change";
}

}  // namespace romap::map_motion_test
