#include "client/eval/relative_motion.h"

#include <gtest/gtest.h>

#include "common/angles.h"
#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval::relative_motion_test {

using eval_world::Orbit;

// Motions with the given true and estimated translation along x.
std::vector<RelativeMotion> AlongX(const std::vector<std::pair<double, double>>& true_and_estimated) {
  std::vector<RelativeMotion> motions;
  for (const auto& [truth, estimated] : true_and_estimated) {
    motions.push_back(
        {.path_m = static_cast<double>(motions.size()), .estimated = {estimated, 0, 0}, .truth = {truth, 0, 0}});
  }
  return motions;
}

std::vector<PosePair> Pairs(const std::vector<files::StampedPose>& poses) {
  std::vector<PosePair> pairs;
  for (const files::StampedPose& pose : poses) {
    pairs.push_back({pose.timestamp_ns, pose.T_world_camera, pose.T_world_camera});
  }
  return pairs;
}

TEST(RelativeMotionTest, TheCorrelationIsWeightedByTrueLengthAndSigned) {
  EXPECT_NEAR(*DirectionCorrelation(AlongX({{1, 5}, {2, 0.1}})), 1, 1e-12);
  EXPECT_NEAR(*DirectionCorrelation(AlongX({{1, -5}, {2, -0.1}})), -1, 1e-12);
  EXPECT_NEAR(*DirectionCorrelation(AlongX({{1, -100}, {3, 1}})), 0.5, 1e-12);
  EXPECT_NEAR(*DirectionCorrelation(AlongX({{1, 1}, {1, 0}})), 0.5, 1e-12) << "no estimated motion counts as 0";
  EXPECT_FALSE(DirectionCorrelation(AlongX({{0, 1}})).has_value());
}

TEST(RelativeMotionTest, TheScaleIsAMedianWithASign) {
  EXPECT_NEAR(*SignedScale(AlongX({{2, 1}, {2, 1}, {2, 100}})), 2, 1e-12);
  EXPECT_NEAR(*SignedScale(AlongX({{2, -1}, {2, -1}, {2, 100}})), -2, 1e-12);
  EXPECT_NEAR(*SignedScale(AlongX({{2, 1}, {2, 1}, {2, 1}, {0.01, 9}, {0.01, 9}})), 2, 1e-12) << "short motions";
  EXPECT_FALSE(SignedScale(AlongX({{2, 1}, {2, 1}})).has_value()) << "too few motions";
  EXPECT_FALSE(SignedScale(AlongX({{2, 0}, {2, 0}, {2, 0}})).has_value()) << "no estimated motion";
  EXPECT_FALSE(SignedScale({}).has_value());
}

TEST(RelativeMotionTest, LocalScalesDivideThePath) {
  const auto motions = AlongX({{1, 1}, {1, 1}, {1, 1}, {1, 1}, {1, 0.5}, {1, 0.5}, {1, 0.5}, {1, 0.5}});
  const std::vector<double> scales = LocalScales(motions, 2);
  ASSERT_EQ(scales.size(), 2u);
  EXPECT_NEAR(scales[0], 1, 1e-12);
  EXPECT_NEAR(scales[1], 2, 1e-12);
}

TEST(RelativeMotionTest, WindowsEndOneSecondLaterAndSkipGaps) {
  std::vector<files::StampedPose> poses = Orbit();  // 25 Hz
  const std::vector<RelativeMotion> windows = WindowMotions(Pairs(poses), 1);
  ASSERT_EQ(windows.size(), 175u);
  EXPECT_EQ(windows[3].end_ns - windows[3].start_ns, 1'000'000'000);
  EXPECT_NEAR(windows[0].rotation_error_deg, 0, 1e-6);
  poses.erase(poses.begin() + 60, poses.begin() + 140);
  for (const RelativeMotion& window : WindowMotions(Pairs(poses), 1)) {
    EXPECT_LE(window.end_ns - window.start_ns, 1'500'000'000);
  }
  EXPECT_TRUE(WindowMotions(Pairs(Orbit(20)), 1).empty());
}

TEST(RelativeMotionTest, ShortTrajectoriesAreMeasuredBetweenFrames) {
  const std::vector<PosePair> pairs = Pairs(Orbit(20));
  const MotionFigures figures = MeasureMotion(pairs, /*extent_m=*/1, /*fit_scale=*/1);
  EXPECT_EQ(figures.window_s, 0);
  EXPECT_NEAR(*figures.window_correlation, 1, 1e-9);
  EXPECT_NEAR(*figures.scale, 1, 1e-9);
}

TEST(RelativeMotionTest, MeasuresRelativeRotationErrors) {
  std::vector<PosePair> pairs = Pairs(Orbit());
  // A yaw drift of 0.1 degrees per frame, 2.5 degrees per second.
  for (size_t k = 0; k < pairs.size(); ++k) {
    const double angle_rad = 0.1 * static_cast<double>(k) * kRadPerDeg;
    const SE3<World, Camera>& pose = pairs[k].truth;
    pairs[k].estimated = {Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ())) * pose.rotation(),
                          pose.translation()};
  }
  const MotionFigures figures = MeasureMotion(pairs, /*extent_m=*/1, /*fit_scale=*/1);
  EXPECT_NEAR(figures.rotation_median_deg, 2.5, 1e-6);
  EXPECT_NEAR(figures.rotation_95_deg, 2.5, 1e-6);
  EXPECT_NEAR(figures.jumps.rotation_deg, 0.1, 1e-6);
}

}  // namespace romap::eval::relative_motion_test
