// Tracker and SparseMapper together, frame by frame on one thread, in a synthetic world.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "common/statistics.h"
#include "server/slam/sparse_mapper.h"
#include "server/slam/tracker.h"
#include "tests/unit/server/slam/textured_world.h"
#include "tests/unit/server/slam/tracking_fixture.h"

namespace romap::slam::tracking_test {

using ::testing::HasSubstr;

TEST_F(TrackingTest, TracksFromImagesAlone) {
  EXPECT_LT(ProcessFrames(90), 25);
  const auto [worst, scale] = Error();
  EXPECT_LT(worst, 0.02);  // for a path of two units
  EXPECT_GT(map().keyframe_count(), 5U);
}

// 4.6 degrees a frame on a busy machine: every result of mapping is two frames late. Without the search by patches,
// frames are lost.
TEST_F(TrackingTest, TracksAFastCameraWhileMappingIsLate) {
  mapper_ = std::make_unique<SparseMapper>(SlamConfig{}, slot_.get(), SparseMapper::Background::kAllAdjustment);
  std::deque<TrackedImage> waiting;
  int initializing = 0;
  int lost = 0;
  for (int i = 0; i < 50; ++i) {
    waiting.push_back(tracker_->Track(world_.Render(static_cast<uint64_t>(i + 1), Pose(4 * i))));
    const TrackedImage& image = waiting.back();
    initializing += image.tracked.state == TrackingState::kInitializing ? 1 : 0;
    lost += image.tracked.state == TrackingState::kLost ? 1 : 0;
    if (waiting.size() < 3) continue;
    mapper_->Process(waiting.front());
    waiting.pop_front();
  }
  EXPECT_EQ(lost, 0);
  EXPECT_LE(initializing, 8);
}

// Mapping is stopped while the camera moves on by the width of its view: nothing that it sees then is in the map.
TEST_F(TrackingTest, TracksNewTerritoryWhileMappingIsStopped) {
  const auto render = [&](int i) {
    const double x_mu = -1.7 + 0.08 * i;
    return world_.Render(static_cast<uint64_t>(i + 1),
                         TexturedWorld::LookAt({x_mu, -0.8 + 0.15 * std::sin(0.2 * i), 1}, {x_mu, 0, 0}));
  };
  int next = 0;
  for (; next < 16; ++next) ProcessFrame(render(next));
  std::deque<TrackedImage> waiting;
  for (; next < 34; ++next) {
    waiting.push_back(tracker_->Track(render(next)));
    EXPECT_EQ(waiting.back().tracked.state, TrackingState::kTracking) << next;
  }
  for (const TrackedImage& image : waiting) mapper_->Process(image);
  for (; next < 42; ++next) EXPECT_EQ(ProcessFrame(render(next)), TrackingState::kTracking) << next;
  EXPECT_LT(Error().first, 0.06);  // after 3.3 units
}

// A part of the robot covers a third of the image and has most of the corners.
TEST_F(TrackingTest, TracksBesideATexturedObjectFixedToTheCamera) {
  const cv::Rect area(0, 110, 210, 130);
  cv::Mat texture(area.height / 4 + 1, area.width / 4 + 1, CV_8UC3);
  cv::RNG random(8);
  random.fill(texture, cv::RNG::UNIFORM, 0, 255);
  cv::resize(texture, texture, area.size(), 0, 0, cv::INTER_NEAREST);
  int tracked = 0;
  for (int i = 0; i < 90; ++i) {
    const auto frame = Render(i);
    texture.copyTo(frame->image_bgr(area));
    tracked += ProcessFrame(frame) == TrackingState::kTracking ? 1 : 0;
  }
  EXPECT_GT(tracked, 55) << reason();
  EXPECT_LT(Error().first, 0.03);
}

TEST_F(TrackingTest, WarnsWhileTheTranslationIsTooSmallToMeasureDistances) {
  const auto warns = [&] { return HasWarning("translation_unobservable"); };
  EXPECT_FALSE(warns()) << "there is no map";
  int next = 0;
  while (next < 10 && mapper_->points() == 0) ProcessFrame(Render(next++));
  ASSERT_GT(mapper_->points(), 0U);
  EXPECT_TRUE(warns()) << "the first two views are about two degrees apart";
  for (; next < 20; ++next) ProcessFrame(Render(next));
  EXPECT_FALSE(warns());
}

TEST_F(TrackingTest, ErrorsLieWithinTheBoundsOfTheirUncertainty) {
  ProcessFrames(100);
  mapper_->Finish();
  const Coverage coverage = MeasureCoverage(/*fix_scale=*/false);
  EXPECT_GE(coverage.position, 0.9);
  EXPECT_GE(coverage.rotation, 0.9);
  EXPECT_LT(coverage.bound_ratio, 6);
}

TEST_F(TrackingTest, ErrorsLieWithinTheBoundsOfTheirUncertaintyWithDepth) {
  for (int i = 0; i < 60; ++i) {
    auto frame = Render(i);
    frame->depth_mu = world_.RenderDepth(*frame);
    ProcessFrame(frame);
  }
  mapper_->Finish();
  const Coverage coverage = MeasureCoverage(/*fix_scale=*/true);
  EXPECT_GE(coverage.position, 0.9);
  EXPECT_GE(coverage.rotation, 0.9);
  EXPECT_LT(coverage.bound_ratio, 8) << "the depth is exact here";
}

TEST_F(TrackingTest, OnlyTrackedFramesHaveAnUncertainty) {
  for (int i = 0; i < 40; ++i) {
    const TrackedImage image = tracker_->Track(Render(i));
    mapper_->Process(image);
    const bool is_tracked = image.tracked.state == TrackingState::kTracking;
    ASSERT_EQ(image.tracked.uncertainty.has_value(), is_tracked) << i;
    if (!is_tracked) continue;
    EXPECT_GT(image.tracked.uncertainty->position_sigma_mu, 0);
    EXPECT_GE(image.tracked.uncertainty->position_sigma_mu, image.tracked.reference_uncertainty.position_sigma_mu);
  }
  Restart(PoseUse::kGiven);
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(tracker_->Track(Render(i)).tracked.uncertainty.has_value());
}

TEST_F(TrackingTest, StaticCameraReportsTooLittleParallax) {
  for (int i = 0; i < 8; ++i) {
    auto frame = Render(0);
    frame->frame_id = static_cast<uint64_t>(i + 1);
    frame->timestamp_ns = i * 33'000'000;
    EXPECT_EQ(ProcessFrame(frame), TrackingState::kInitializing);
  }
  EXPECT_THAT(reason(), HasSubstr("too little parallax"));
  EXPECT_EQ(map().keyframe_count(), 0U);
}

TEST_F(TrackingTest, RotatingCameraReportsTooLittleParallax) {
  for (int i = 0; i < 12; ++i) {
    const SE3<World, Camera> pose = TexturedWorld::LookAt({1.2, 0, 1.2}, {0.02 * i, 0.04 * i, 0});
    EXPECT_EQ(ProcessFrame(world_.Render(static_cast<uint64_t>(i + 1), pose)), TrackingState::kInitializing) << i;
  }
  EXPECT_THAT(reason(), HasSubstr("parallax"));
}

TEST_F(TrackingTest, RelocalizesAfterACoveredLens) {
  ProcessFrames(60);
  const size_t keyframes = map().keyframe_count();
  for (int i = 60; i < 66; ++i) {
    auto frame = Render(i);
    frame->image_bgr.setTo(0);
    EXPECT_EQ(ProcessFrame(frame), TrackingState::kLost);
    EXPECT_THAT(reason(), HasSubstr("texture"));
  }
  EXPECT_EQ(map().keyframe_count(), keyframes);
  EXPECT_EQ(ProcessFrame(Render(66)), TrackingState::kRelocalized) << reason();
  EXPECT_EQ(ProcessFrame(Render(67)), TrackingState::kTracking) << reason();
  EXPECT_EQ(SparseMapperInspector(*mapper_).maps_begun(), 1);
  EXPECT_LT(Error().first, 0.02);
}

TEST_F(TrackingTest, RelocalizesAMovedCameraInTheSameMap) {
  ProcessFrames(110);
  // Unrelated images, then a much earlier pose, so that the last frames do not help.
  for (int i = 110; i < 113; ++i) {
    auto frame = world_.Render(static_cast<uint64_t>(i + 1), Pose(i));
    cv::Mat noise(frame->image_bgr.size(), CV_8UC3);
    cv::RNG random(static_cast<uint64_t>(i));
    random.fill(noise, cv::RNG::UNIFORM, 0, 255);
    cv::GaussianBlur(noise, frame->image_bgr, {7, 7}, 0);
    EXPECT_EQ(ProcessFrame(frame), TrackingState::kLost);
  }
  int relocalized_after = -1;
  for (int i = 0; i < 10 && relocalized_after < 0; ++i) {
    auto frame = world_.Render(static_cast<uint64_t>(120 + i), Pose(20 + i));
    if (ProcessFrame(frame) == TrackingState::kRelocalized) relocalized_after = i;
  }
  EXPECT_GE(relocalized_after, 0) << "not relocalized: " << reason();
  EXPECT_LE(relocalized_after, 3);
  EXPECT_EQ(SparseMapperInspector(*mapper_).maps_begun(), 1);
  EXPECT_LT(Error().first, 0.03);
}

TEST_F(TrackingTest, DepthGivesTheScaleFromTheFirstFrame) {
  for (int i = 0; i < 40; ++i) {
    auto frame = Render(i);
    frame->depth_mu = world_.RenderDepth(*frame);
    const TrackingState state = ProcessFrame(frame);
    EXPECT_EQ(state, i == 0 ? TrackingState::kInitializing : TrackingState::kTracking) << i << ": " << reason();
  }
  const auto [worst, scale] = Error();
  EXPECT_NEAR(scale, 1, 0.01);
  EXPECT_LT(worst, 0.02);
}

TEST_F(TrackingTest, SameFramesGiveTheSamePoses) {
  std::vector<Eigen::Matrix4d> first;
  for (int round = 0; round < 2; ++round) {
    Restart(PoseUse::kIgnore);
    for (int i = 0; i < 45; ++i) ProcessFrame(Render(i));
    if (round == 0) {
      for (const TrackedPose& frame : frames_) first.push_back(frame.tracked.T_world_camera.Matrix());
    }
  }
  ASSERT_EQ(first.size(), frames_.size());
  for (size_t i = 0; i < first.size(); ++i) EXPECT_EQ(first[i], frames_[i].tracked.T_world_camera.Matrix()) << i;
}

TEST_F(TrackingTest, ClientGravityAlignsZWithUp) {
  const Eigen::Vector3d down_world = -Eigen::Vector3d::UnitZ();
  for (int i = 0; i < 45; ++i) {
    auto frame = Render(i);
    frame->gravity_camera = frame->T_world_camera->rotation().conjugate() * down_world;
    ProcessFrame(frame);
  }
  ASSERT_FALSE(frames_.empty());
  EXPECT_LT(UpError_deg(), 0.5);
}

// The first camera looks down by 40 degrees and defines the map's up direction until objects show the support plane.
TEST_F(TrackingTest, SupportPlaneAlignsZWithUp) {
  for (int i = 0; i < 60; ++i) {
    auto frame = Render(i);
    LabelTile(*frame);
    ProcessFrame(frame);
  }
  mapper_->Finish();
  EXPECT_LT(UpError_deg(), 0.5);
}

TEST_F(TrackingTest, LateMasksAlignZWithUp) {
  std::deque<FrameMasks> late;
  for (int i = 0; i < 60; ++i) {
    auto frame = Render(i);
    LabelTile(*frame);
    late.push_back(TakeMasks(*frame));
    ProcessFrame(frame);
    if (late.size() <= 15) continue;
    mapper_->ObserveMasks(late.front());
    late.pop_front();
  }
  EXPECT_LT(UpError_deg(), 1);
  for (const FrameMasks& masks : late) mapper_->ObserveMasks(masks);
  mapper_->Finish();
  EXPECT_LT(UpError_deg(), 0.5);
}

TEST_F(TrackingTest, MasksOfNonKeyframesAlignZWithUp) {
  int keyframes_without = 0, others_with = 0;
  for (int i = 0; i < 60; ++i) {
    auto frame = Render(i);
    LabelTile(*frame);
    const FrameMasks masks = TakeMasks(*frame);
    const TrackingState state = ProcessFrame(frame);
    if (state != TrackingState::kTracking || mapped_.view) {
      ++keyframes_without;
      continue;
    }
    mapper_->ObserveMasks(masks);
    ++others_with;
  }
  EXPECT_GT(keyframes_without, 5);
  EXPECT_GT(others_with, 3);
  mapper_->Finish();
  EXPECT_LT(UpError_deg(), 0.5);
}

TEST_F(TrackingTest, TracksFromImagesWhenGivenPosesStop) {
  Restart(PoseUse::kGiven);
  for (int i = 0; i < 40; ++i) {
    auto frame = Render(i);
    EXPECT_EQ(ProcessFrame(frame), TrackingState::kTracking);
    EXPECT_EQ(mapped_.tracked.T_world_camera.Matrix(), frame->T_world_camera->Matrix());
  }
  for (int i = 40; i < 60; ++i) {
    auto frame = Render(i);
    const SE3<World, Camera> truth = *frame->T_world_camera;
    frame->T_world_camera.reset();
    const TrackedImage image = tracker_->Track(frame);
    mapped_ = mapper_->Process(image);
    ASSERT_EQ(image.tracked.state, TrackingState::kTracking) << i << ": " << image.tracked.reason;
    // In the client's world and units, without any alignment.
    EXPECT_LT((mapped_.tracked.T_world_camera.translation() - truth.translation()).norm(), 0.02) << i;
  }
  auto frame = Render(60);
  EXPECT_EQ(ProcessFrame(frame), TrackingState::kTracking);
  EXPECT_EQ(mapped_.tracked.T_world_camera.Matrix(), frame->T_world_camera->Matrix());
}

TEST_F(TrackingTest, ImagesCorrectPriors) {
  Restart(PoseUse::kPrior);
  std::mt19937_64 random(9);
  std::normal_distribution<double> noise(0, 0.01);
  double prior_error = 0, tracking_error = 0;
  for (int i = 0; i < 70; ++i) {
    auto frame = Render(i);
    const SE3<World, Camera> truth = *frame->T_world_camera;
    const Eigen::Vector3d off(noise(random), noise(random), noise(random));
    frame->T_world_camera = SE3<World, Camera>(truth.rotation(), truth.translation() + off);
    const TrackedImage image = tracker_->Track(frame);
    mapped_ = mapper_->Process(image);
    EXPECT_EQ(image.tracked.state, TrackingState::kTracking) << i;
    if (i < 30) continue;
    prior_error += off.norm();
    tracking_error += (mapped_.tracked.T_world_camera.translation() - truth.translation()).norm();
  }
  EXPECT_LT(tracking_error, 0.7 * prior_error);
}

}  // namespace romap::slam::tracking_test
