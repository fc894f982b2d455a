#include "server/slam/up_estimator.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

namespace romap::slam::up_estimator_test {

// A frame with the gravity of a world whose up direction is `up_world`.
Frame FrameWithGravity(const Eigen::Vector3d& up_world, const SE3<World, Camera>& T_world_camera) {
  Frame frame;
  frame.gravity_camera = -(T_world_camera.rotation().conjugate() * up_world).normalized();
  return frame;
}

double AngleBetween_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

TEST(UpEstimator, IsWorldZWithoutGravity) {
  UpEstimator up;
  up.Add(Frame{}, {});
  EXPECT_EQ(up.up_world(), Eigen::Vector3d::UnitZ());
}

TEST(UpEstimator, FollowsGravityWhileTheCameraRotates) {
  const Eigen::Vector3d truth = Eigen::Vector3d(0.2, -0.9, 0.3).normalized();
  UpEstimator up;
  for (int i = 0; i < 5; ++i) {
    const SE3<World, Camera> pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.4 * i, Eigen::Vector3d(1, 2, 3).normalized())),
                                  Eigen::Vector3d::Zero());
    up.Add(FrameWithGravity(truth, pose), pose);
    EXPECT_LT(AngleBetween_deg(up.up_world(), truth), 1e-6);
  }
}

TEST(UpEstimator, AveragesNoiseAndIgnoresJolts) {
  const Eigen::Vector3d truth = Eigen::Vector3d::UnitY();
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 0.03);
  UpEstimator up;
  for (int i = 0; i < 100; ++i) {
    const bool jolt = i % 5 == 4;
    const Eigen::Vector3d measured = truth + Eigen::Vector3d(noise(random), noise(random), noise(random)) +
                                     (jolt ? 2.0 : 0.0) * Eigen::Vector3d::UnitX();
    up.Add(FrameWithGravity(measured.normalized(), {}), {});
  }
  EXPECT_LT(AngleBetween_deg(up.up_world(), truth), 0.6);
}

}  // namespace romap::slam::up_estimator_test
