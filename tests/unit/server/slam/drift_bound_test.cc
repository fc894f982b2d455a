#include "server/slam/drift_bound.h"

#include <gtest/gtest.h>

#include <numbers>

#include "common/angles.h"
#include "tests/unit/server/slam/loop_world.h"

namespace romap::slam::drift_bound_test {

TEST(DriftBoundTest, GrowsWithThePath) {
  LoopWorld world(LoopWorld::kKeyframesPerRound, {});
  const auto bound = [&](uint64_t to, bool scale_is_known) {
    return DriftBetween(world.map(), KeyframeId{1}, KeyframeId{to}, scale_is_known);
  };
  EXPECT_EQ(bound(11, true).path_keyframes, 11);
  EXPECT_NEAR(bound(11, true).turn_rad, 10 * 12 * kRadPerDeg, 1e-6);
  EXPECT_LT(bound(6, true).rotation_rad, bound(20, true).rotation_rad);
  EXPECT_LT(bound(6, true).translation_mu, bound(20, true).translation_mu);
  EXPECT_EQ(bound(20, true).log_scale, 0);
  EXPECT_GT(bound(20, false).log_scale, 0.05);
  EXPECT_LT(bound(20, false).log_scale, 0.5);
}

TEST(DriftBoundTest, SeparatesDriftFromJumps) {
  LoopWorld world(LoopWorld::kKeyframesPerRound, {});
  const DriftBound bound = DriftBetween(world.map(), KeyframeId{1}, world.newest().id, /*scale_is_known=*/true);
  const auto moved = [](double angle_deg, double shift_mu, double scale) {
    return Sim3<World, World>(scale,
                              Eigen::Quaterniond(Eigen::AngleAxisd(angle_deg * kRadPerDeg, Eigen::Vector3d::UnitZ())),
                              Eigen::Vector3d(0, 0, shift_mu));
  };
  EXPECT_TRUE(IsWithin(bound, moved(3, 0.1, 1), world.newest()));
  EXPECT_FALSE(IsWithin(bound, moved(90, 0, 1), world.newest()));
  EXPECT_FALSE(IsWithin(bound, moved(0, 2.5, 1), world.newest()));
  EXPECT_FALSE(IsWithin(bound, moved(0, 0, 1.1), world.newest()));
}

}  // namespace romap::slam::drift_bound_test
