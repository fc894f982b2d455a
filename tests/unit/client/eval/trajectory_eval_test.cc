#include "client/eval/trajectory_eval.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval {
namespace {

using eval_world::Moved;
using eval_world::Orbit;
using eval_world::OtherWorld;
using eval_world::TempFolder;
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
  const Eigen::Quaterniond roll(Eigen::AngleAxisd(2 * std::numbers::pi / 180, Eigen::Vector3d::UnitZ()));
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
  std::vector<files::StampedPose> still = eval_world::Orbit();
  for (files::StampedPose& pose : still) pose.T_world_camera = {};
  EXPECT_THAT(std::string(Evaluate(still, Alignment::kSim3).status().message()), HasSubstr("positions coincide"));
  EXPECT_EQ(EvaluateTrajectory({.estimated = folder_ / "no", .ground_truth = folder_ / "gt.txt"}).status().code(),
            absl::StatusCode::kNotFound);
}

}  // namespace
}  // namespace romap::eval
