#include "server/slam/given_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/unit/server/slam/tracking_fixture.h"

namespace romap::slam::given_world_test {

using ::testing::HasSubstr;

class LatePosesTest : public TrackingTest {
 protected:
  LatePosesTest() : TrackingTest(PoseUse::kGiven) {}

  // Processes frames without pose until there is a map. Returns the number of the next one.
  int StartWithoutPoses() {
    int next = 0;
    for (; next < 10; ++next) {
      auto frame = Render(next);
      frame->T_world_camera.reset();
      mapper_->Process(tracker_->Track(frame));
    }
    EXPECT_GT(mapper_->points(), 0U);
    return next;
  }

  std::string PosesIgnoredText() const {
    for (const Diagnostic& diagnostic : mapper_->Diagnostics()) {
      if (diagnostic.code == "poses_ignored") return diagnostic.text;
    }
    return "";
  }
};

TEST_F(LatePosesTest, MoveTheMapIntoTheirWorld) {
  int next = StartWithoutPoses();
  EXPECT_FALSE(HasWarning("poses_ignored"));
  for (; next < 14; ++next) EXPECT_EQ(ProcessFrame(Render(next)), TrackingState::kTracking);
  EXPECT_TRUE(HasWarning("poses_ignored"));
  for (; next < 70; ++next) EXPECT_EQ(ProcessFrame(Render(next)), TrackingState::kTracking);
  EXPECT_EQ(PosesIgnoredText(), "");
  const SE3<World, Camera> truth = Pose(next - 1);
  EXPECT_LT((mapped_.tracked.T_world_camera.translation() - truth.translation()).norm(), 0.02);
  EXPECT_LT(mapped_.tracked.T_world_camera.rotation().angularDistance(truth.rotation()), 0.01);
  EXPECT_NEAR(Error().second, 1, 0.01) << "frames before the poses moved, too";
}

// Most frames with a pose are no keyframes.
TEST_F(LatePosesTest, AFewPosesSuffice) {
  for (int next = StartWithoutPoses(); next < 70; ++next) {
    auto frame = Render(next);
    if (next % 15 != 0) frame->T_world_camera.reset();
    EXPECT_EQ(ProcessFrame(frame, Pose(next)), TrackingState::kTracking);
  }
  EXPECT_EQ(PosesIgnoredText(), "");
  EXPECT_NEAR(Error().second, 1, 0.02);
}

TEST_F(LatePosesTest, AFewPosesThatContradictTheImagesAreRefused) {
  for (int next = StartWithoutPoses(); next < 70; ++next) {
    auto frame = Render(next);
    const SE3<Camera, World> inverse = frame->T_world_camera->Inverse();
    frame->T_world_camera = SE3<World, Camera>(inverse.rotation(), inverse.translation());
    if (next % 15 != 0) frame->T_world_camera.reset();
    EXPECT_EQ(ProcessFrame(frame, Pose(next)), TrackingState::kTracking);
  }
  EXPECT_NE(PosesIgnoredText(), "");
}

// T_camera_world instead of T_world_camera: a usual mistake.
TEST_F(LatePosesTest, AreRefusedIfTheyContradictTheImages) {
  for (int next = StartWithoutPoses(); next < 90; ++next) {
    auto frame = Render(next);
    const SE3<Camera, World> inverse = frame->T_world_camera->Inverse();
    frame->T_world_camera = SE3<World, Camera>(inverse.rotation(), inverse.translation());
    EXPECT_EQ(ProcessFrame(frame), TrackingState::kTracking);
  }
  EXPECT_THAT(PosesIgnoredText(), HasSubstr("contradict the images"));
}

}  // namespace romap::slam::given_world_test
