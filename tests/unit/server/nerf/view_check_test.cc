#include "server/nerf/view_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <string>

#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::view_check_test {

using ::testing::HasSubstr;
using testing_support::BallScene;

// The error of a view of the ball after `modify`.
template <class Modify>
std::string ErrorOf(Modify&& modify) {
  const BallScene scene;
  ObjectView view = scene.View(0);
  modify(view);
  const absl::Status status = ValidateView(view, TrainingBox::Around(scene.Box(), 0.1));
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  return std::string(status.message());
}

TEST(ViewCheckTest, AcceptsValidViews) {
  BallScene scene;
  scene.with_depth = true;
  EXPECT_TRUE(ValidateView(scene.View(0), TrainingBox::Around(scene.Box(), 0.1)).ok());
}

TEST(ViewCheckTest, NamesObjectKeyframeAndError) {
  EXPECT_EQ(ErrorOf([](ObjectView& v) { v.ray_kind = cv::Mat::zeros(v.roi_px.size(), CV_8UC1); }),
            "view of object/7 in keyframe/1: mask is empty");
  EXPECT_THAT(ErrorOf([](ObjectView& v) { v.keyframe = {}; }), HasSubstr("keyframe id is missing"));
}

TEST(ViewCheckTest, RejectsInvalidPosesAndCameras) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(ErrorOf([&](ObjectView& v) {
                v.T_world_camera = {Eigen::Quaterniond::Identity(), Eigen::Vector3d::Constant(nan)};
              }),
              HasSubstr("pose is not finite"));
  EXPECT_THAT(ErrorOf([](ObjectView& v) { v.camera.fx_px = 0; }), HasSubstr("object/7"));
  EXPECT_THAT(ErrorOf([&](ObjectView& v) { v.camera.cx_px = nan; }), HasSubstr("object/7"));
  EXPECT_THAT(ErrorOf([](ObjectView& v) { v.camera.distortion[0] = 0.1; }), HasSubstr("distortion"));
  EXPECT_THAT(ErrorOf([](ObjectView& v) {
                const Eigen::AngleAxisd turn(M_PI, Eigen::Vector3d::UnitY());
                v.T_world_camera = {Eigen::Quaterniond(v.T_world_camera.RotationMatrix() * turn.toRotationMatrix()),
                                    v.T_world_camera.translation()};
              }),
              HasSubstr("behind the camera"));
}

TEST(ViewCheckTest, RejectsInvalidImages) {
  EXPECT_THAT(ErrorOf([](ObjectView& v) { v.color_bgr = cv::Mat::zeros(10, 12, CV_8UC3); }),
              HasSubstr("color_bgr must be 72x72 px like the crop, is 12x10 px"));
  EXPECT_THAT(ErrorOf([](ObjectView& v) { v.depth_mu = cv::Mat::zeros(v.roi_px.size(), CV_16UC1); }),
              HasSubstr("depth_mu must be CV_32FC1"));
  EXPECT_THAT(ErrorOf([](ObjectView& v) { v.roi_px.x = 5; }), HasSubstr("must be inside the image"));
  EXPECT_THAT(ErrorOf([](ObjectView& v) {
                v.ray_kind.setTo(static_cast<int>(RayKind::kBackground));
                v.ray_kind.at<uint8_t>(30, 30) = static_cast<uint8_t>(RayKind::kObject);
              }),
              HasSubstr("mask must have at least 16 object pixels, has 1"));
}

}  // namespace romap::nerf::view_check_test
