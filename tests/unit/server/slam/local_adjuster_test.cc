#include "server/slam/local_adjuster.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/unit/server/slam/noisy_map.h"

namespace romap::slam::local_adjuster_test {

class LocalAdjusterTest : public NoisyMap {
 protected:
  const MapKeyframe& newest() const { return map_.keyframes().rbegin()->second; }
};

TEST_F(LocalAdjusterTest, OnTheCallingThreadTheMapIsAdjustedAtOnce) {
  LocalAdjuster adjuster(SlamConfig{}, /*run_inline=*/true);
  adjuster.Adjust(newest(), map_);
  EXPECT_LT(RmsError_px(), 0.01);
  EXPECT_FALSE(adjuster.Apply(/*wait=*/true, map_)) << "nothing is pending";
  EXPECT_EQ(adjuster.times().runs, 1);
}

TEST_F(LocalAdjusterTest, InTheBackgroundTheMapChangesInApply) {
  LocalAdjuster adjuster(SlamConfig{}, /*run_inline=*/false);
  const std::vector<Eigen::Vector3d> before = Centers();
  adjuster.Adjust(newest(), map_);
  EXPECT_EQ(Centers(), before);
  EXPECT_TRUE(adjuster.Apply(/*wait=*/true, map_));
  EXPECT_LT(RmsError_px(), 0.01);
}

TEST_F(LocalAdjusterTest, KeyframesAndPointsAddedMeanwhileMoveAlong) {
  LocalAdjuster adjuster(SlamConfig{}, /*run_inline=*/false);
  adjuster.Adjust(newest(), map_);
  MapKeyframe& parent = map_.keyframes().rbegin()->second;
  MapKeyframe& newer = AddKeyframe(1.6, 0.02);
  newer.parent = parent.id;
  PointTrack& point = map_.AddPoint({0.3, 0.2, 4});
  map_.AddObservation(point, newer, 3);
  const SE3<Camera, Camera> T_parent_newer = parent.T_camera_world() * newer.T_world_camera();
  const Eigen::Vector3d p_newer = newer.T_camera_world() * point.point.position_world;
  const Eigen::Vector3d center_before = newer.center_world();
  ASSERT_TRUE(adjuster.Apply(/*wait=*/true, map_));
  EXPECT_GT((newer.center_world() - center_before).norm(), 1e-4);
  EXPECT_TRUE((parent.T_camera_world() * newer.T_world_camera()).Matrix().isApprox(T_parent_newer.Matrix(), 1e-9));
  EXPECT_LT((newer.T_camera_world() * point.point.position_world - p_newer).norm(), 1e-9);
}

TEST_F(LocalAdjusterTest, ResultsForRemovedKeyframesAndPointsAreIgnored) {
  LocalAdjuster adjuster(SlamConfig{}, /*run_inline=*/false);
  adjuster.Adjust(newest(), map_);
  const MapPointId point = map_.points().begin()->first;
  const KeyframeId keyframe = map_.keyframes().rbegin()->first;
  map_.keyframes().rbegin()->second.parent = map_.keyframes().begin()->first;
  map_.RemovePoint(point);
  map_.RemoveKeyframe(keyframe);
  ASSERT_TRUE(adjuster.Apply(/*wait=*/true, map_));
  EXPECT_EQ(map_.FindPoint(point), nullptr);
  EXPECT_EQ(map_.FindKeyframe(keyframe), nullptr);
  EXPECT_LT(RmsError_px(), 0.01);
}

TEST_F(LocalAdjusterTest, ADiscardedWindowIsAdjustedAgain) {
  LocalAdjuster adjuster(SlamConfig{}, /*run_inline=*/false);
  adjuster.Adjust(newest(), map_);
  adjuster.Discard();
  // The discarded result would be relative to the world before this.
  map_.Transform({1, Eigen::Quaterniond::Identity(), Eigen::Vector3d(5, 0, 0)});
  const Eigen::Vector3d first_center_world = Centers().front();
  EXPECT_TRUE(adjuster.Apply(/*wait=*/true, map_));
  EXPECT_LT(RmsError_px(), 0.01);
  EXPECT_LT((Centers().front() - first_center_world).norm(), 0.1);
}

TEST_F(LocalAdjusterTest, ResetForgetsThePendingRun) {
  LocalAdjuster adjuster(SlamConfig{}, /*run_inline=*/false);
  const std::vector<Eigen::Vector3d> before = Centers();
  adjuster.Adjust(newest(), map_);
  adjuster.Reset();
  EXPECT_FALSE(adjuster.Apply(/*wait=*/true, map_));
  EXPECT_EQ(Centers(), before);
}

}  // namespace romap::slam::local_adjuster_test
