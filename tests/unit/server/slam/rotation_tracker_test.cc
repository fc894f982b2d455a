#include "server/slam/rotation_tracker.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "common/angles.h"
#include "server/slam/features/feature_extractor.h"
#include "server/slam/optimize/lie.h"
#include "tests/unit/server/slam/tracking_fixture.h"

namespace romap::slam::rotation_tracker_test {

// Sways by 25 degrees about all axes within 60 frames, 2 degrees per frame at most.
Eigen::Quaterniond Sway(int i) {
  return ExpRotation({0.25 * std::sin(0.1 * i), 0.4 * std::sin(0.08 * i), 0.3 * std::sin(0.12 * i)});
}

class RotationTrackerTest : public TrackingTest {
 protected:
  std::shared_ptr<Frame> RenderInPlace(int i) const {
    const SE3<World, Camera> pose = TexturedWorld::LookAt({1.2, 0, 1.3}, {0, 0, 0.1});
    return world_.Render(static_cast<uint64_t>(i + 1), {pose.rotation() * Sway(i), pose.translation()});
  }

  std::shared_ptr<const FrameFeatures> Extract(const Frame& frame) {
    return MakeFrameFeatures(frame, extractor_.ExtractScene(frame));
  }

  FeatureExtractor extractor_{SlamConfig{}};
};

// Without translation there is no map, but the rotation is known.
TEST_F(RotationTrackerTest, ACameraThatRotatesInPlaceHasARotationWithoutAMap) {
  std::optional<Eigen::Quaterniond> first;
  double worst_deg = 0;
  int refused = 0;  // the evidence of a single frame may be too weak
  for (int i = 0; i < 60; ++i) {
    ASSERT_EQ(ProcessFrame(RenderInPlace(i)), TrackingState::kInitializing) << i;
    const auto& rotation = mapped_.tracked.R_world_camera;
    refused += rotation ? 0 : 1;
    if (!rotation) continue;
    if (!first) first = rotation;
    const Eigen::Quaterniond motion = first->conjugate() * *rotation;
    worst_deg = std::max(worst_deg, kDegPerRad * motion.angularDistance(Sway(0).conjugate() * Sway(i)));
  }
  EXPECT_LT(worst_deg, 0.3);
  EXPECT_LE(refused, 3);
}

TEST_F(RotationTrackerTest, ParallaxIsNotARotation) {
  RotationTracker tracker{SlamConfig{}};
  const auto first = world_.Render(1, TexturedWorld::LookAt({1.2, 0, 1.0}, {0, 0, 0.3}));
  const auto moved = world_.Render(2, TexturedWorld::LookAt({1.2, 0.25, 1.0}, {0, 0, 0.3}));
  tracker.Start(Extract(*first), Eigen::Quaterniond::Identity());
  EXPECT_FALSE(tracker.Track(Extract(*moved)).has_value());
}

// The image of a plane moves almost as if the camera rotated. What passes for a rotation must remain small.
TEST_F(RotationTrackerTest, ATranslationAlongAPlaneIsNoRotationForLong) {
  RotationTracker tracker{SlamConfig{}};
  double worst_deg = 0;
  int refused = 0;
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d eye(1.3 + 0.01 * i, 1.3, 1.5);
    const auto features = Extract(
        *world_.Render(static_cast<uint64_t>(i + 1), TexturedWorld::LookAt(eye, eye - Eigen::Vector3d(0, 0, 1))));
    if (i == 0) tracker.Start(features, Eigen::Quaterniond::Identity());
    const auto rotation = tracker.Track(features);
    refused += rotation ? 0 : 1;
    if (rotation) worst_deg = std::max(worst_deg, kDegPerRad * Eigen::AngleAxisd(*rotation).angle());
  }
  EXPECT_LT(worst_deg, 1);
  EXPECT_GT(refused, 10);
}

// A tracked camera that turns away from its map is lost, but keeps its rotation in the world of the map.
TEST_F(RotationTrackerTest, ALostCameraKeepsItsRotation) {
  ProcessFrames(30);
  const SE3<World, Camera> last_truth = Pose(29);
  const Eigen::Quaterniond last = mapped_.tracked.T_world_camera.rotation();
  int lost = 0;
  double worst_deg = 0;
  for (int i = 30; i < 60; ++i) {
    const Eigen::Quaterniond turn = ExpRotation({0, 0.05 * (i - 29), 0});
    const auto frame =
        world_.Render(static_cast<uint64_t>(i + 1), {last_truth.rotation() * turn, last_truth.translation()});
    if (ProcessFrame(frame) != TrackingState::kLost) continue;
    if (!image_.tracked.R_world_camera) continue;
    ++lost;
    const Eigen::Quaterniond motion = last.conjugate() * *image_.tracked.R_world_camera;
    worst_deg = std::max(worst_deg, kDegPerRad * motion.angularDistance(turn));
  }
  EXPECT_GT(lost, 3);
  EXPECT_LT(worst_deg, 1);
}

}  // namespace romap::slam::rotation_tracker_test
