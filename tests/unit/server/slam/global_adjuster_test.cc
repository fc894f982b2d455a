#include "server/slam/global_adjuster.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/unit/server/slam/noisy_map.h"

namespace romap::slam::global_adjuster_test {

using GlobalAdjusterTest = NoisyMap;

TEST_F(GlobalAdjusterTest, RemovesTheErrorsOfTheMap) {
  ASSERT_GT(RmsError_px(), 1);
  const Eigen::Vector3d first_center_world = Centers().front();
  GlobalAdjuster adjuster(SlamConfig{}, /*run_inline=*/true);
  adjuster.Start(map_, /*find_lens=*/false);
  EXPECT_TRUE(adjuster.IsPending());
  EXPECT_GT(RmsError_px(), 1) << "the map changes only in Apply";
  EXPECT_TRUE(adjuster.Apply(/*wait=*/false, map_));
  EXPECT_FALSE(adjuster.IsPending());
  EXPECT_LT(RmsError_px(), 0.01);
  EXPECT_EQ(Centers().front(), first_center_world);
}

TEST_F(GlobalAdjusterTest, BackgroundRunGivesTheSameResult) {
  SlamMap copy = map_;
  GlobalAdjuster inline_adjuster(SlamConfig{}, /*run_inline=*/true);
  inline_adjuster.Start(copy, /*find_lens=*/false);
  ASSERT_TRUE(inline_adjuster.Apply(/*wait=*/false, copy));
  GlobalAdjuster adjuster(SlamConfig{}, /*run_inline=*/false);
  adjuster.Start(map_, /*find_lens=*/false);
  ASSERT_TRUE(adjuster.Apply(/*wait=*/true, map_));
  for (const auto& [id, keyframe] : map_.keyframes()) {
    EXPECT_EQ(keyframe.center_world(), copy.FindKeyframe(id)->center_world()) << id;
  }
}

TEST_F(GlobalAdjusterTest, NewerKeyframesMoveWithTheirParents) {
  GlobalAdjuster adjuster(SlamConfig{}, /*run_inline=*/true);
  adjuster.Start(map_, /*find_lens=*/false);
  const MapKeyframe& parent = map_.keyframes().rbegin()->second;
  MapKeyframe& newer = AddKeyframe(1.6, 0.02);
  newer.parent = parent.id;
  const Eigen::Vector3d center_before = newer.center_world();
  const SE3<Camera, Camera> T_parent_newer = parent.T_camera_world() * newer.T_world_camera();
  ASSERT_TRUE(adjuster.Apply(/*wait=*/false, map_));
  EXPECT_GT((newer.center_world() - center_before).norm(), 1e-4);
  EXPECT_TRUE((parent.T_camera_world() * newer.T_world_camera()).Matrix().isApprox(T_parent_newer.Matrix(), 1e-9));
}

TEST_F(GlobalAdjusterTest, ResultFollowsAMapThatIsMovedAsAWhole) {
  const Sim3<World, World> S_new_old(1, Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY())),
                                     Eigen::Vector3d(1, -2, 0.5));
  GlobalAdjuster adjuster(SlamConfig{}, /*run_inline=*/true);
  adjuster.Start(map_, /*find_lens=*/false);
  map_.Transform(S_new_old);
  adjuster.Move(S_new_old);
  const Eigen::Vector3d first_center_world = Centers().front();
  ASSERT_TRUE(adjuster.Apply(/*wait=*/false, map_));
  EXPECT_LT(RmsError_px(), 0.01);
  EXPECT_LT((Centers().front() - first_center_world).norm(), 1e-9);
}

TEST_F(GlobalAdjusterTest, CancelDiscardsTheRun) {
  const std::vector<Eigen::Vector3d> before = Centers();
  for (const bool run_inline : {false, true}) {
    GlobalAdjuster adjuster(SlamConfig{}, run_inline);
    adjuster.Start(map_, /*find_lens=*/false);
    adjuster.Cancel();
    EXPECT_FALSE(adjuster.IsPending());
    EXPECT_FALSE(adjuster.Apply(/*wait=*/true, map_));
  }
  EXPECT_EQ(Centers(), before);
}

TEST_F(GlobalAdjusterTest, GivenPosesAreNotAdjusted) {
  const std::vector<Eigen::Vector3d> before = Centers();
  for (auto& [id, keyframe] : map_.keyframes()) keyframe.pose_given = true;
  GlobalAdjuster adjuster(SlamConfig{}, /*run_inline=*/true);
  adjuster.Start(map_, /*find_lens=*/false);
  EXPECT_FALSE(adjuster.Apply(/*wait=*/false, map_));
  EXPECT_FALSE(adjuster.IsPending());
  EXPECT_EQ(Centers(), before);
}

}  // namespace romap::slam::global_adjuster_test
