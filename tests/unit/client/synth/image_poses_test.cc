#include "client/synth/image_poses.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "client/synth/synth_camera.h"
#include "common/lens.h"

namespace romap::synth::image_poses_test {

// A camera at (0, 0, -1 m) that faces along z; rotates by `pitch_rad` and `yaw_rad` and moves by `move_m` during the
// readout.
std::vector<SE3<World, Camera>> Rows(const CameraModel& camera, double pitch_rad, double yaw_rad, double move_m) {
  std::vector<SE3<World, Camera>> rows;
  for (int v = 0; v < camera.height_px; ++v) {
    const double share = (v + 0.5) / camera.height_px - 0.5;
    const Eigen::Quaterniond rotation = Eigen::AngleAxisd(share * yaw_rad, Eigen::Vector3d::UnitY()) *
                                        Eigen::AngleAxisd(share * pitch_rad, Eigen::Vector3d::UnitX());
    rows.emplace_back(rotation, Eigen::Vector3d(share * move_m, 0, -1));
  }
  return rows;
}

TEST(ImagePosesTest, GlobalShutterHasOnePose) {
  const SE3<World, Camera> pose(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())),
                                Eigen::Vector3d(1, 2, 3));
  const ImagePoses poses(pose);
  EXPECT_FALSE(poses.Rolling());
  EXPECT_EQ(poses.Row(0).translation(), pose.translation());
  EXPECT_EQ(poses.Row(100).translation(), pose.translation());
  const Eigen::Vector3d p_world(0.3, 0.1, 8);
  EXPECT_LT((poses.CameraPoint(p_world) - pose.Inverse() * p_world).norm(), 1e-12);
}

TEST(ImagePosesTest, InterpolatesBetweenRows) {
  const CameraModel camera = SynthCamera({.width_px = 64, .height_px = 48});
  const ImagePoses poses(camera, Rows(camera, 0, 0.48, 0.48));
  EXPECT_TRUE(poses.Rolling());
  EXPECT_NEAR(poses.Row(10.25).translation().x(), (10.75 / 48 - 0.5) * 0.48, 1e-9);
  EXPECT_NEAR(poses.Row(10.25).rotation().angularDistance(poses.Row(11.25).rotation()), 0.01, 1e-9);
  EXPECT_EQ(poses.Row(-5).translation(), poses.Row(0).translation());
  EXPECT_EQ(poses.Row(60).translation(), poses.Row(47).translation());
}

TEST(ImagePosesTest, PointsAreVisibleInTheRowOfTheirPose) {
  for (const SynthLens lens : {SynthLens::kPinhole, SynthLens::kFisheye}) {
    const CameraModel camera = SynthCamera({.lens = lens});
    // A pitch moves the content by up to 60 rows during the readout.
    for (const double pitch_rad : {0.1, -0.1}) {
      const ImagePoses poses(camera, Rows(camera, pitch_rad, 0.1, 0.05));
      for (double x = -0.3; x <= 0.3; x += 0.1) {
        for (double y = -0.3; y <= 0.3; y += 0.1) {
          const Eigen::Vector3d p_world(x, y, 0.2);
          const Eigen::Vector3d p_camera = poses.CameraPoint(p_world);
          const Eigen::Vector2d pixel_px = DistortPixel(camera, camera.Project(p_camera));
          const Eigen::Vector3d expected = poses.Row(pixel_px.y()).Inverse() * p_world;
          EXPECT_LT((p_camera - expected).norm(), 5e-5) << x << ' ' << y;
        }
      }
    }
  }
}

}  // namespace romap::synth::image_poses_test
