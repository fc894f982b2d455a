#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "client/eval/eval.h"
#include "client/files/text_file.h"
#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval::run_eval_test {

using eval_world::Box;
using eval_world::Moved;
using eval_world::TempFolder;
using eval_world::UprightCuboid;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const MapAlignment kGiven{Alignment::kNone, "test"};
const MapAlignment kEstimated{Alignment::kSim3, "test"};

class RunEvalTest : public testing::Test {
 protected:
  // Writes a sequence with one box, and a run that mapped it in the world of `S_run_true`. All but the run is moved by
  // `S_set`.
  void Write(const Sim3<World, World>& S_run_true, const Sim3<World, World>& S_set = {}) {
    const Eigen::Vector3d half_extents(0.1, 0.07, 0.05);
    files::ObjectRecord truth = eval_world::UprightCuboid(1, {0, 0, 0}, 0, S_set.scale() * half_extents);
    files::ObjectRecord found =
        eval_world::UprightCuboid(5, S_run_true.translation(), 0, S_run_true.scale() * half_extents);
    found.T_world_object = S_run_true.Moved(truth.T_world_object);
    truth.T_world_object = S_set.Moved(truth.T_world_object);
    const Mesh box = eval_world::Box(half_extents, {0, 0, 0});
    EXPECT_TRUE(files::WriteWorldPly(folder_ / "set/gt/b1.ply", box, FromObject(S_set)).ok());
    EXPECT_TRUE(files::WriteObjects(folder_ / "set/objects.yaml", {.objects = {truth}}).ok());
    EXPECT_TRUE(files::WriteTum(folder_ / "set/groundtruth.txt", Moved(eval_world::Orbit(), S_set)).ok());
    EXPECT_TRUE(files::WriteWorldPly(folder_ / "run/objects/5_box.ply", box, FromObject(S_run_true)).ok());
    EXPECT_TRUE(files::WriteObjects(folder_ / "run/cuboids.json", {.objects = {found}}).ok());
    EXPECT_TRUE(files::WriteTum(folder_ / "run/trajectory.txt", Moved(eval_world::Orbit(), S_run_true)).ok());
  }

  // `S` of an object at the origin.
  static Sim3<World, Object> FromObject(const Sim3<World, World>& S) {
    return {S.scale(), S.rotation(), S.translation()};
  }

  eval_world::TempFolder folder_;
};

TEST_F(RunEvalTest, DoesNotAlignWithGivenPoses) {
  Write({});
  const RunReport report = EvaluateRun(folder_ / "run", folder_ / "set", kGiven);
  EXPECT_THAT(report.notes, SizeIs(0));
  ASSERT_TRUE(report.objects && report.boxes && report.trajectory);
  EXPECT_FALSE(report.objects->rows[0].match->icp.has_value());
  EXPECT_LT(*report.objects->mean.accuracy_cm, 0.1);
  EXPECT_NEAR(report.boxes->iou_all, 1, 1e-7);
  EXPECT_EQ(report.trajectory->alignment, Alignment::kNone);
}

TEST_F(RunEvalTest, AlignsByTrajectoriesWithEstimatedPoses) {
  Write(eval_world::OtherWorld());
  const RunReport report = EvaluateRun(folder_ / "run", folder_ / "set", kEstimated);
  EXPECT_THAT(report.notes, SizeIs(0));
  ASSERT_TRUE(report.objects && report.boxes && report.trajectory);
  EXPECT_NEAR(report.objects->trajectory_scale, 1 / 0.37, 1e-6);
  EXPECT_LT(*report.objects->mean.accuracy_cm, 0.1);
  EXPECT_NEAR(report.boxes->iou_all, 1, 1e-5);
  EXPECT_LT(report.trajectory->ate_rmse_m, 1e-6);
}

TEST_F(RunEvalTest, TheFiguresDoNotDependOnTheOrigin) {
  const Eigen::Vector3d far_away(500'000.3, -6'400'000.7, 100);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ()));
  const auto evaluate = [&](const Eigen::Vector3d& origin, const MapAlignment& alignment) {
    Write({1, turn, origin + Eigen::Vector3d(0.01, 0.005, 0)}, {1, Eigen::Quaterniond::Identity(), origin});
    return EvaluateRun(folder_ / "run", folder_ / "set", alignment);
  };
  for (const MapAlignment& alignment : {kGiven, kEstimated}) {
    const RunReport near = evaluate({0, 0, 0}, alignment);
    const RunReport distant = evaluate(far_away, alignment);
    ASSERT_TRUE(near.objects && near.boxes && near.trajectory);
    ASSERT_TRUE(distant.objects && distant.boxes && distant.trajectory);
    EXPECT_NEAR(*distant.objects->mean.accuracy_cm, *near.objects->mean.accuracy_cm, 1e-4);
    EXPECT_NEAR(*distant.objects->mean.completion_cm, *near.objects->mean.completion_cm, 1e-4);
    EXPECT_NEAR(distant.boxes->iou_all, near.boxes->iou_all, 1e-6);
    EXPECT_NEAR(distant.boxes->center_cm, near.boxes->center_cm, 1e-6);
    EXPECT_NEAR(distant.trajectory->ate_rmse_m, near.trajectory->ate_rmse_m, 1e-7);
  }
}

TEST_F(RunEvalTest, TablesKeepTheDigitsOfSmallFigures) {
  BoxesReport report;
  report.matched = 1;
  report.center_cm = 0.0000123;
  EXPECT_THAT(FormatTable(report), HasSubstr("  1.23e-05"));
  TrajectoryReport in_kilometers;
  in_kilometers.extent_m = 0.0007;
  in_kilometers.ate_rmse_m = 0.0000109;
  EXPECT_THAT(FormatTable(in_kilometers), AllOf(HasSubstr("ATE rmse 0.000010900 m"), HasSubstr("extent 0.000700 m")));
}

TEST_F(RunEvalTest, NotesFiguresThatCannotBeMeasured) {
  const RunReport nothing = EvaluateRun(folder_ / "run/x", folder_ / "set/x", kGiven);
  EXPECT_THAT(nothing.notes, SizeIs(3));
  EXPECT_THAT(nothing.notes[0], AllOf(HasSubstr("meshes not measured"), HasSubstr("run/x/objects")));
  Write({});
  ASSERT_TRUE(files::WriteFile(folder_ / "run/cuboids.json", "{\"objects\": 5}").ok());
  const RunReport report = EvaluateRun(folder_ / "run", folder_ / "set", kGiven);
  ASSERT_THAT(report.notes, SizeIs(1));
  EXPECT_THAT(report.notes[0], AllOf(HasSubstr("cuboids not measured"), HasSubstr("the list 'objects:' is missing")));
  EXPECT_TRUE(report.objects && report.trajectory);
}

TEST_F(RunEvalTest, AnUnusableTrajectoryIsWrong) {
  Write({});
  ASSERT_TRUE(files::WriteTum(folder_ / "run/trajectory.txt", {}).ok());
  const RunReport empty = EvaluateRun(folder_ / "run", folder_ / "set", kEstimated);
  ASSERT_TRUE(empty.verdict.has_value());
  EXPECT_EQ(empty.verdict->level, VerdictLevel::kWrong);
  EXPECT_THAT(FormatTrajectory(empty), AllOf(HasSubstr("trajectory verdict: WRONG"), HasSubstr("contains no poses")));
  std::filesystem::remove(folder_ / "set/groundtruth.txt");
  const RunReport unknown = EvaluateRun(folder_ / "run", folder_ / "set", kEstimated);
  EXPECT_FALSE(unknown.verdict.has_value());
  EXPECT_EQ(FormatTrajectory(unknown), "");
}

TEST_F(RunEvalTest, TablesAndJsonContainTheFigures) {
  Write({});
  const RunReport report = EvaluateRun(folder_ / "run", folder_ / "set", kGiven);
  const std::string table = FormatTable(report);
  EXPECT_THAT(table, AllOf(HasSubstr("acc.seen"), HasSubstr("5_box"), HasSubstr("1 of 1"), HasSubstr("IoU3D"),
                           HasSubstr("ATE rmse 0.000000 m"), HasSubstr("alignment with the ground truth: none (test)"),
                           HasSubstr("trajectory verdict: GOOD")));
  const nlohmann::ordered_json json = ToJson(report);
  EXPECT_EQ(json["objects"]["objects"][0]["predicted"], "5_box");
  EXPECT_EQ(json["objects"]["mean"]["ratio_1"], 100.0);
  EXPECT_NEAR(json["boxes"]["mean"]["iou_all_gt"].get<double>(), 1, 1e-7);
  EXPECT_EQ(json["trajectory"]["matched"], 200);
  EXPECT_EQ(json["verdict"]["level"], "GOOD");
  EXPECT_EQ(json["trajectory"]["frames"]["lost"], 0);
}

}  // namespace romap::eval::run_eval_test
