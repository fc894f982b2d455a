#include "server/slam/loop_detector.h"

#include <gtest/gtest.h>

#include <numbers>

#include "common/angles.h"
#include "tests/unit/server/slam/loop_world.h"

namespace romap::slam::loop_detector_test {

constexpr LoopWorld::Drift kDrift{.rotation_deg = 0.12, .shift_mu = 0.003};

std::optional<LoopMatch> Find(LoopWorld& world) {
  return LoopDetector(SlamConfig{}, &world.map(), &world.places()).Find(world.newest(), /*scale_is_known=*/true);
}

TEST(LoopDetectorTest, FindsTheReturnToAWallAndItsDrift) {
  LoopWorld world(LoopWorld::kKeyframesPerRound + 4, kDrift);
  const auto loop = Find(world);
  ASSERT_TRUE(loop);
  EXPECT_LE(loop->old.value, 8U);
  EXPECT_GT(loop->drift_px, kNoDrift_px);
  // The correction undoes the drift between the old keyframe and the newest.
  const int newest = static_cast<int>(world.newest().id.value) - 1;
  const int old = static_cast<int>(loop->old.value) - 1;
  const Sim3<World, World> expected = world.DriftAt(old) * world.DriftAt(newest).Inverse();
  const Sim3<World, World> correction = loop->Correction(world.map());
  EXPECT_LT(correction.rotation().angularDistance(expected.rotation()), 0.4 * kRadPerDeg);
  const Eigen::Vector3d& center = world.newest().center_world();
  EXPECT_LT((correction * center - expected * center).norm(), 0.05);
}

TEST(LoopDetectorTest, FindsAReturnWithoutDrift) {
  LoopWorld world(LoopWorld::kKeyframesPerRound + 4, {});
  const auto loop = Find(world);
  ASSERT_TRUE(loop);
  EXPECT_LT(loop->drift_px, kNoDrift_px);
}

TEST(LoopDetectorTest, FindsNothingBeforeTheReturn) {
  LoopWorld world(LoopWorld::kKeyframesPerRound - 8, kDrift);
  EXPECT_FALSE(Find(world));
}

// Half a round after the start, the camera sees a wall that looks exactly like the first one.
TEST(LoopDetectorTest, WallsThatLookAlikeAreNoLoop) {
  LoopWorld world(LoopWorld::kKeyframesPerRound / 2 + 4, kDrift, {.opposite_walls_look_alike = true});
  // The descriptors and the geometry alone would be convincing.
  const MapKeyframe& opposite = *world.map().FindKeyframe(KeyframeId{4});
  ASSERT_TRUE(world.places().Locate(*world.newest().frame, opposite, 1));
  EXPECT_FALSE(Find(world));
}

TEST(LoopDetectorTest, OneKeyframeAtTheOldPlaceIsNoProof) {
  // The newest keyframe is the first one that sees enough of the first wall.
  for (int keyframes = LoopWorld::kKeyframesPerRound - 4; keyframes < LoopWorld::kKeyframesPerRound + 4; ++keyframes) {
    LoopWorld world(keyframes, kDrift);
    if (!Find(world)) continue;
    const MapKeyframe& old = *world.map().FindKeyframe(KeyframeId{1});
    int locating = 0;
    for (const auto& [id, keyframe] : world.map().keyframes()) {
      if (id.value > 15) locating += world.places().Locate(*keyframe.frame, old, 1) ? 1 : 0;
    }
    EXPECT_GE(locating, 2);
    return;
  }
  FAIL() << "the loop was never found";
}

TEST(LoopDetectorTest, ARejectedLoopIsNotProposedAgain) {
  LoopWorld world(LoopWorld::kKeyframesPerRound + 4, kDrift);
  LoopDetector detector(SlamConfig{}, &world.map(), &world.places());
  const auto loop = detector.Find(world.newest(), /*scale_is_known=*/true);
  ASSERT_TRUE(loop);
  detector.Reject(*loop);
  EXPECT_FALSE(detector.Find(world.newest(), /*scale_is_known=*/true));
}

}  // namespace romap::slam::loop_detector_test
