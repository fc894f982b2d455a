#include "server/objects/edge_yaw.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

namespace romap::objects::edge_yaw_test {

constexpr double kYaw_rad = 0.3;

// Views of a flat square on the ground from a half circle around it.
std::vector<Silhouette> ObserveSquare() {
  std::vector<Silhouette> silhouettes;
  for (int i = 0; i < 8; ++i) {
    const double azimuth = std::numbers::pi * i / 8;
    const Eigen::Vector3d center(1.2 * std::cos(azimuth), 1.2 * std::sin(azimuth), 0.9);
    Eigen::Matrix3d R_world_camera;
    R_world_camera.col(2) = -center.normalized();
    R_world_camera.col(0) = R_world_camera.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
    R_world_camera.col(1) = R_world_camera.col(2).cross(R_world_camera.col(0));
    Silhouette silhouette;
    silhouette.camera = {.width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500, .cx_px = 319.5, .cy_px = 239.5};
    silhouette.T_world_camera = {R_world_camera, center};
    const Eigen::AngleAxisd turn(kYaw_rad, Eigen::Vector3d::UnitZ());
    const auto pixel = [&](double x, double y) {
      return silhouette.camera.Project(silhouette.T_world_camera.Inverse() * (turn * Eigen::Vector3d(x, y, 0)));
    };
    for (const double side : {-0.1, 0.1}) {
      silhouette.segments.push_back({pixel(-0.1, side), pixel(0.1, side)});
      silhouette.segments.push_back({pixel(side, -0.1), pixel(side, 0.1)});
    }
    silhouettes.push_back(std::move(silhouette));
  }
  return silhouettes;
}

TEST(EdgeYawTest, IsRelativeToTheGrid) {
  const auto estimate = EdgeYaw(ObserveSquare(), Eigen::Matrix3d::Identity());
  ASSERT_TRUE(estimate.has_value());
  EXPECT_NEAR(estimate->yaw_rad, kYaw_rad, 1e-6);
  EXPECT_GT(estimate->confidence, 0.25);
  const Eigen::Matrix3d turned = Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_NEAR(EdgeYaw(ObserveSquare(), turned).value_or(YawEstimate{}).yaw_rad, kYaw_rad - 0.2, 1e-6);
}

// Silhouettes and their edges rotate with a correction of the map.
TEST(EdgeYawTest, FollowsCorrections) {
  std::vector<Silhouette> silhouettes = ObserveSquare();
  const Sim3<World, World> S_new_old(1.5, Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ())),
                                     {1, 2, 3});
  for (Silhouette& silhouette : silhouettes) Move(S_new_old, &silhouette);
  const auto estimate = EdgeYaw(silhouettes, Eigen::Matrix3d::Identity());
  ASSERT_TRUE(estimate.has_value());
  EXPECT_NEAR(estimate->yaw_rad, kYaw_rad + 0.1, 1e-6);
}

TEST(EdgeYawTest, ReturnsNothingWithoutEdges) {
  EXPECT_FALSE(EdgeYaw({}, Eigen::Matrix3d::Identity()).has_value());
  std::vector<Silhouette> plain = ObserveSquare();
  for (Silhouette& silhouette : plain) silhouette.segments.clear();
  EXPECT_FALSE(EdgeYaw(plain, Eigen::Matrix3d::Identity()).has_value());
}

}  // namespace romap::objects::edge_yaw_test
