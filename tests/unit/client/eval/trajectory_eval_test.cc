#include "client/eval/trajectory_eval.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "common/angles.h"
#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval::trajectory_eval_test {

using eval_world::Moved;
using eval_world::Orbit;
using eval_world::OtherWorld;
using eval_world::TempFolder;
using eval_world::WithLocalScale;
using ::testing::HasSubstr;

class TrajectoryEvalTest : public testing::Test {
 protected:
  // Evaluates `estimated` against the orbit.
  absl::StatusOr<TrajectoryReport> Evaluate(const std::vector<files::StampedPose>& estimated, Alignment alignment) {
    EXPECT_TRUE(files::WriteTum(folder_ / "gt.txt", eval_world::Orbit()).ok());
    EXPECT_TRUE(files::WriteTum(folder_ / "est.txt", estimated).ok());
    return EvaluateTrajectory(
        {.estimated = folder_ / "est.txt", .ground_truth = folder_ / "gt.txt", .alignment = alignment});
  }

  eval_world::TempFolder folder_;
};

TEST_F(TrajectoryEvalTest, ATrajectoryComparedWithItselfIsExact) {
  for (const Alignment alignment : {Alignment::kNone, Alignment::kSe3, Alignment::kSim3}) {
    const auto report = Evaluate(eval_world::Orbit(), alignment);
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_LT(report->ate_rmse_m, 1e-8);
    EXPECT_EQ(report->matched, 200u);
  }
}

TEST_F(TrajectoryEvalTest, RecoversAKnownSimilarity) {
  const auto report = Evaluate(Moved(eval_world::Orbit(), eval_world::OtherWorld()), Alignment::kSim3);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_LT(report->ate_rmse_m, 1e-7);
  EXPECT_NEAR(report->scale, 1 / 0.37, 1e-6);
  EXPECT_LT(report->rotation_rmse_deg, 1e-4);
}

TEST_F(TrajectoryEvalTest, RigidAlignmentLeavesTheScaleError) {
  const auto report = Evaluate(Moved(eval_world::Orbit(), eval_world::OtherWorld()), Alignment::kSe3);
  ASSERT_TRUE(report.ok()) << report.status();
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const files::StampedPose& pose : eval_world::Orbit()) mean += pose.T_world_camera.translation() / 200;
  double squared_radius = 0;
  for (const files::StampedPose& pose : eval_world::Orbit()) {
    squared_radius += (pose.T_world_camera.translation() - mean).squaredNorm() / 200;
  }
  EXPECT_NEAR(report->ate_rmse_m, (1 - 0.37) * std::sqrt(squared_radius), 1e-7);
  EXPECT_EQ(report->scale, 1);
}

TEST_F(TrajectoryEvalTest, MeasuresAKnownTranslationAndRoll) {
  std::vector<files::StampedPose> poses = eval_world::Orbit();
  const Eigen::Quaterniond roll(Eigen::AngleAxisd(2 * kRadPerDeg, Eigen::Vector3d::UnitZ()));
  for (files::StampedPose& pose : poses) {
    pose.T_world_camera = {pose.T_world_camera.rotation() * roll,
                           Eigen::Vector3d(pose.T_world_camera.translation() + Eigen::Vector3d(0.03, 0.04, 0))};
  }
  const auto report = Evaluate(poses, Alignment::kNone);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_NEAR(report->ate_rmse_m, 0.05, 1e-8);
  EXPECT_NEAR(report->ate_median_m, 0.05, 1e-8);
  EXPECT_NEAR(report->rotation_rmse_deg, 2, 1e-5);
  EXPECT_NEAR(report->rotation_max_deg, 2, 1e-5);
  EXPECT_NEAR(Evaluate(poses, Alignment::kSe3)->ate_rmse_m, 0, 1e-8);
}

TEST_F(TrajectoryEvalTest, NamesTheReasonWhyAlignmentFails) {
  std::vector<files::StampedPose> late = eval_world::Orbit();
  for (files::StampedPose& pose : late) pose.timestamp_ns += 1'000'000'000'000;
  EXPECT_THAT(std::string(Evaluate(late, Alignment::kSim3).status().message()),
              HasSubstr("only 0 of 200 estimated poses"));
  EXPECT_EQ(EvaluateTrajectory({.estimated = folder_ / "no", .ground_truth = folder_ / "gt.txt"}).status().code(),
            absl::StatusCode::kNotFound);
}

// Compares with the orbit; the frames of the run are those of the orbit.
TrajectoryReport CompareWithOrbit(const std::vector<files::StampedPose>& estimated) {
  std::vector<int64_t> frames_ns;
  for (const files::StampedPose& pose : Orbit()) frames_ns.push_back(pose.timestamp_ns);
  const auto report = CompareTrajectories({.estimated = estimated, .ground_truth = Orbit(), .frames_ns = frames_ns},
                                          Alignment::kSim3, 0.02);
  EXPECT_TRUE(report.ok()) << report.status();
  return report.value_or(TrajectoryReport{});
}

TEST(CompareTrajectoriesTest, APerfectTrajectoryInAnotherWorldIsGood) {
  const TrajectoryReport report = CompareWithOrbit(Moved(Orbit(), OtherWorld()));
  EXPECT_NEAR(*report.motion.frame_correlation, 1, 1e-9);
  EXPECT_NEAR(*report.motion.window_correlation, 1, 1e-9);
  EXPECT_NEAR(*report.motion.scale, 1 / 0.37, 1e-6);
  EXPECT_NEAR(report.motion.jumps.position_m, 0, 1e-7);
  EXPECT_EQ(report.coverage.tracked, 200u);
  EXPECT_EQ(report.verdict.level, VerdictLevel::kGood) << FormatLine(report.verdict);
}

TEST(CompareTrajectoriesTest, DriftingScaleIsDegraded) {
  const TrajectoryReport report =
      CompareWithOrbit(WithLocalScale(Orbit(), [](size_t k) { return 1 + 0.3 * static_cast<double>(k) / 200; }));
  ASSERT_EQ(report.motion.local_scales.size(), 5u);
  EXPECT_NEAR(report.motion.local_scales.back() / report.motion.local_scales.front(), 1.04 / 1.24, 0.03);
  EXPECT_EQ(report.verdict.level, VerdictLevel::kDegraded);
  EXPECT_THAT(FormatLine(report.verdict), HasSubstr("scale varies by a factor of 1."));
}

// Positions reflected in the center of the orbit, with true orientations. For a planar orbit the alignment turns them
// by 180 degrees, so that the ATE is 0.
TEST(CompareTrajectoriesTest, ReversedTranslationIsWrongEvenWithoutAte) {
  std::vector<files::StampedPose> truth = Orbit(), reversed;
  for (files::StampedPose& pose : truth) {
    Eigen::Vector3d position = pose.T_world_camera.translation();
    position.z() = 0;
    pose.T_world_camera = {pose.T_world_camera.rotation(), position};
    reversed.push_back({pose.timestamp_ns, {pose.T_world_camera.rotation(), Eigen::Vector3d(-0.5 * position)}});
  }
  const auto report = CompareTrajectories({.estimated = reversed, .ground_truth = truth}, Alignment::kSim3, 0.02);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_LT(report->ate_rmse_m, 1e-6);
  EXPECT_NEAR(*report->motion.window_correlation, -1, 1e-9);
  EXPECT_NEAR(*report->motion.scale, -2, 1e-6);
  EXPECT_EQ(report->verdict.level, VerdictLevel::kWrong);
  EXPECT_THAT(FormatLine(report->verdict), HasSubstr("translation correlation over 1 s is -1.00"));
}

TEST(CompareTrajectoriesTest, UnrelatedPositionsHaveNoScale) {
  std::vector<files::StampedPose> noise = Orbit();
  for (files::StampedPose& pose : noise) {
    pose.T_world_camera = {pose.T_world_camera.rotation(), Eigen::Vector3d(0, 0, 0)};
  }
  const TrajectoryReport still = CompareWithOrbit(noise);
  EXPECT_FALSE(still.motion.scale.has_value());
  EXPECT_EQ(still.verdict.level, VerdictLevel::kWrong);
  const TrajectoryReport report = CompareWithOrbit(eval_world::WithNoise(noise, 1, 7));
  EXPECT_FALSE(report.motion.scale.has_value());
  EXPECT_THAT(report.motion.scale_note, HasSubstr("exceeds the true translation"));
  EXPECT_GT(report.AteShare(), 0.9);
  EXPECT_EQ(report.verdict.level, VerdictLevel::kWrong);
}

TEST(CompareTrajectoriesTest, PureRotationIsJudgedByRotationOnly) {
  std::vector<files::StampedPose> truth = Orbit();
  for (files::StampedPose& pose : truth)
    pose.T_world_camera = {pose.T_world_camera.rotation(), Eigen::Vector3d(1, 2, 3)};
  const std::vector<files::StampedPose> estimated = Moved(eval_world::WithNoise(truth, 0.1, 3), OtherWorld());
  const auto report = CompareTrajectories({.estimated = estimated, .ground_truth = truth}, Alignment::kSim3, 0.02);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_FALSE(report->motion.scale.has_value());
  EXPECT_FALSE(report->motion.window_correlation.has_value());
  EXPECT_LT(report->rotation_rmse_deg, 1e-3);  // aligned by the orientations
  EXPECT_EQ(report->verdict.level, VerdictLevel::kGood) << FormatLine(report->verdict);
  EXPECT_THAT(FormatLine(report->verdict), HasSubstr("translation not judged"));
}

TEST(CompareTrajectoriesTest, ReportsTheLargestJump) {
  std::vector<files::StampedPose> poses = Orbit();
  for (size_t k = 100; k < poses.size(); ++k) {
    const SE3<World, Camera>& pose = poses[k].T_world_camera;
    poses[k].T_world_camera = {pose.rotation(), Eigen::Vector3d(pose.translation() + Eigen::Vector3d(0, 0, 0.3))};
  }
  const TrajectoryReport report = CompareWithOrbit(poses);
  EXPECT_NEAR(report.motion.jumps.position_m, 0.3, 0.05);
  EXPECT_NEAR(report.motion.jumps.position_s, 4, 1e-6);
  EXPECT_GT(*report.motion.frame_correlation, 0.98);  // one jump does not dominate
  EXPECT_EQ(report.verdict.level, VerdictLevel::kDegraded);
  EXPECT_THAT(FormatLine(report.verdict), HasSubstr("position jumps by"));
}

TEST(CompareTrajectoriesTest, APartlyTrackedSequenceIsDegraded) {
  std::vector<files::StampedPose> poses = Orbit();
  poses.erase(poses.begin() + 100, poses.begin() + 160);
  poses.erase(poses.begin(), poses.begin() + 10);
  const TrajectoryReport report = CompareWithOrbit(poses);
  EXPECT_EQ(report.coverage.tracked, 130u);
  EXPECT_EQ(report.coverage.before_first, 10u);
  EXPECT_EQ(report.coverage.lost, 60u);
  EXPECT_EQ(report.verdict.level, VerdictLevel::kDegraded);
  EXPECT_THAT(FormatLine(report.verdict), HasSubstr("only 65.0 % of the frames tracked"));
}

TEST(CompareTrajectoriesTest, MeasuresCalibrationIfSigmasAreGiven) {
  std::vector<files::StampedPose> estimated = Moved(eval_world::WithNoise(Orbit(), 0.02, 5), OtherWorld());
  EXPECT_FALSE(CompareWithOrbit(estimated).calibration.has_value());
  for (files::StampedPose& pose : estimated) pose.uncertainty = PoseUncertainty{0.37 * 0.02, 0.02};
  const auto report = CompareTrajectories({.estimated = estimated, .ground_truth = Orbit()}, Alignment::kSim3, 0.02);
  ASSERT_TRUE(report.ok()) << report.status();
  ASSERT_TRUE(report->calibration.has_value());
  EXPECT_NEAR(report->calibration->position_coverage, 0.95, 0.04);
  EXPECT_NEAR(report->calibration->position_bound_ratio, 1.82, 0.15);
  EXPECT_EQ(report->calibration->rotation_coverage, 1);
}

}  // namespace romap::eval::trajectory_eval_test
