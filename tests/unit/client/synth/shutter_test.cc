#include "client/synth/shutter.h"

#include <gtest/gtest.h>

#include <cmath>

#include "client/synth/scene.h"
#include "client/synth/synth_camera.h"
#include "common/angles.h"

namespace romap::synth::shutter_test {

class ShutterTest : public ::testing::Test {
 protected:
  // An orbit by 0.9 degrees per frame.
  static SynthOptions Options() { return {.seed = 2, .objects = 2, .frames = 100, .arc_deg = 90}; }

  const Scene scene_ = MakeScene({.seed = 2, .objects = 2});
};

TEST_F(ShutterTest, MiddleRowHasThePoseOfTheFrame) {
  SynthOptions options = Options();
  options.readout = 0.5;
  const CameraModel camera = SynthCamera(options);
  const CameraPath path(options, scene_, camera);
  const ImagePoses poses = PosesOfImage(path, camera, options, 40);
  ASSERT_TRUE(poses.Rolling());
  const double middle_px = 0.5 * (camera.height_px - 1);
  EXPECT_LT((poses.Row(middle_px).translation() - path.Pose(40).translation()).norm(), 1e-6);
  EXPECT_NEAR(poses.Row(0).rotation().angularDistance(poses.Row(camera.height_px - 1).rotation()), 0.45 * kRadPerDeg,
              0.01 * kRadPerDeg);
  EXPECT_LT((poses.Row(0).translation() - path.Pose(40, -0.25).translation()).norm(), 1e-4)
      << "the first row is the earliest";
}

TEST_F(ShutterTest, GlobalShutterByDefault) {
  const SynthOptions options = Options();
  const CameraModel camera = SynthCamera(options);
  const CameraPath path(options, scene_, camera);
  EXPECT_FALSE(PosesOfImage(path, camera, options, 40).Rolling());
  EXPECT_TRUE(PosesDuringExposure(path, camera, options, 40, 1).empty());
}

TEST_F(ShutterTest, ExposureIsCenteredAndSampledByImageMotion) {
  SynthOptions options = Options();
  options.exposure = 0.8;
  const CameraModel camera = SynthCamera(options);
  const CameraPath path(options, scene_, camera);
  const auto moments = PosesDuringExposure(path, camera, options, 40, 1);
  // 0.72 degrees at a focal length of 576 px are about 7 px at the image border.
  ASSERT_GE(moments.size(), 3U);
  EXPECT_LE(moments.size(), 10U);
  const Eigen::Vector3d first = moments.front().Row(0).translation();
  const Eigen::Vector3d last = moments.back().Row(0).translation();
  EXPECT_LT((0.5 * (first + last) - path.Pose(40).translation()).norm(), 1e-4);
  const double expected_m = (path.Pose(41).translation() - path.Pose(40).translation()).norm() * 0.8;
  const double covered = 1 - 1.0 / static_cast<double>(moments.size());
  EXPECT_NEAR((last - first).norm(), covered * expected_m, 1e-4);
}

TEST_F(ShutterTest, NoBlurWithoutMotion) {
  SynthOptions options = Options();
  options.exposure = 1;
  options.arc_deg = 0.01;
  const CameraModel camera = SynthCamera(options);
  EXPECT_TRUE(PosesDuringExposure(CameraPath(options, scene_, camera), camera, options, 40, 1).empty());
}

}  // namespace romap::synth::shutter_test
