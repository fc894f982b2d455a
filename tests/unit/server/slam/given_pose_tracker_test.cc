#include "server/slam/given_pose_tracker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::given_pose_tracker_test {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::Ge;
using ::testing::Le;

std::shared_ptr<Frame> BlackFrame(uint64_t frame_id, const SE3<World, Camera>& T_world_camera) {
  auto frame = std::make_shared<Frame>();
  frame->frame_id = frame_id;
  frame->camera = {.width_px = 64, .height_px = 48, .fx_px = 60, .fy_px = 60, .cx_px = 31.5, .cy_px = 23.5};
  frame->image_bgr = cv::Mat::zeros(48, 64, CV_8UC3);
  frame->has_masks = true;
  frame->labels = cv::Mat::zeros(48, 64, CV_16UC1);
  frame->T_world_camera = T_world_camera;
  return frame;
}

std::vector<uint64_t> Keyframes(const std::vector<std::shared_ptr<Frame>>& frames) {
  GivenPoseTracker tracker{SlamConfig{}};
  std::vector<uint64_t> keyframes;
  for (const auto& frame : frames) {
    const auto tracked = tracker.Track(frame);
    if (tracked.is_keyframe) keyframes.push_back(frame->frame_id);
  }
  return keyframes;
}

TEST(GivenPoseTracker, ReturnsTheGivenPoseAndTheFrame) {
  GivenPoseTracker tracker{SlamConfig{}};
  const auto frame = BlackFrame(5, TexturedWorld::OrbitPose(30));
  const auto tracked = tracker.Track(frame);
  EXPECT_EQ(tracked.frame, frame);
  EXPECT_EQ(tracked.state, TrackingState::kTracking);
  EXPECT_EQ(tracked.T_world_camera.Matrix(), frame->T_world_camera->Matrix());
  EXPECT_EQ(tracked.up_world, Eigen::Vector3d::UnitZ());
  EXPECT_TRUE(tracked.is_keyframe);
}

TEST(GivenPoseTracker, SetsUpFromGravity) {
  GivenPoseTracker tracker{SlamConfig{}};
  const auto frame = BlackFrame(1, TexturedWorld::OrbitPose(0));
  const Eigen::Vector3d up_world = Eigen::Vector3d::UnitY();
  frame->gravity_camera = -(frame->T_world_camera->rotation().conjugate() * up_world);
  const auto tracked = tracker.Track(frame);
  EXPECT_LT((tracked.up_world - up_world).norm(), 1e-9);
}

TEST(GivenPoseTracker, EverySecondFrameOfAnOrbitIsAKeyframe) {
  std::vector<std::shared_ptr<Frame>> frames;
  for (int i = 0; i < 40; ++i) frames.push_back(BlackFrame(i, TexturedWorld::OrbitPose(3.5 * i)));
  EXPECT_THAT(Keyframes(frames).size(), AllOf(Ge(18), Le(22)));
}

TEST(GivenPoseTracker, EveryFrameOfAFastOrbitIsAKeyframe) {
  std::vector<std::shared_ptr<Frame>> frames;
  for (int i = 0; i < 10; ++i) frames.push_back(BlackFrame(i, TexturedWorld::OrbitPose(12.0 * i)));
  EXPECT_EQ(Keyframes(frames).size(), 10);
}

TEST(GivenPoseTracker, TranslatingCameraGetsAKeyframeEveryFewFrames) {
  const TexturedWorld world;
  std::vector<std::shared_ptr<Frame>> frames;
  for (int i = 0; i < 60; ++i) {
    const double x_mu = -0.5 + 0.013 * i;  // 0.4 mu/s at 30 Hz, two map units away
    frames.push_back(world.Render(static_cast<uint64_t>(i), TexturedWorld::LookAt({x_mu, 0.5, 2}, {x_mu, 0.5, 0})));
  }
  EXPECT_THAT(Keyframes(frames).size(), AllOf(Ge(60 / 9), Le(60 / 4)));
}

TEST(GivenPoseTracker, StaticCameraGetsOneKeyframe) {
  std::vector<std::shared_ptr<Frame>> frames;
  for (int i = 0; i < 100; ++i) frames.push_back(BlackFrame(i, TexturedWorld::OrbitPose(0.001 * (i % 3))));
  EXPECT_THAT(Keyframes(frames), ElementsAre(0));
}

TEST(GivenPoseTracker, SlowCameraGetsAKeyframeAfterTheMaximumGap) {
  SlamConfig config;
  std::vector<std::shared_ptr<Frame>> frames;
  for (int i = 0; i < 100; ++i) frames.push_back(BlackFrame(i, TexturedWorld::OrbitPose(0.05 * i)));
  EXPECT_EQ(Keyframes(frames).size(), 1 + 99 / static_cast<size_t>(config.keyframe_max_gap_frames));
}

TEST(GivenPoseTracker, AcceptsImplausibleJumps) {
  const SE3<World, Camera> far_away(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1e7, -1e7, 1e7));
  EXPECT_THAT(Keyframes({BlackFrame(1, TexturedWorld::OrbitPose(0)), BlackFrame(2, far_away),
                         BlackFrame(3, TexturedWorld::OrbitPose(1))}),
              ElementsAre(1, 2, 3));
}

TEST(GivenPoseTracker, DueKeyframeWaitsAFewFramesForASharpFrame) {
  const TexturedWorld world;
  std::vector<std::shared_ptr<Frame>> frames;  // stands still, then rotates by more than the threshold
  for (int i = 0; i < 16; ++i) {
    frames.push_back(world.Render(static_cast<uint64_t>(i), TexturedWorld::OrbitPose(i < 10 ? 0 : 4 + 0.1 * i)));
    if (i >= 10) cv::blur(frames.back()->image_bgr, frames.back()->image_bgr, {15, 1});
  }
  EXPECT_THAT(Keyframes(frames), ElementsAre(0, 10 + 3));
  frames[12] = world.Render(12, TexturedWorld::OrbitPose(5.2));
  EXPECT_THAT(Keyframes(frames), ElementsAre(0, 12));
}

TEST(GivenPoseTracker, DueKeyframeWaitsForMasksIfOnlySomeFramesHaveThem) {
  std::vector<std::shared_ptr<Frame>> frames;
  for (int i = 0; i < 30; ++i) {
    frames.push_back(BlackFrame(i, TexturedWorld::OrbitPose(1.6 * i)));
    frames.back()->has_masks = i % 3 == 0;
  }
  for (const uint64_t keyframe : Keyframes(frames)) EXPECT_EQ(keyframe % 3, 0) << keyframe;
}

}  // namespace romap::slam::given_pose_tracker_test
