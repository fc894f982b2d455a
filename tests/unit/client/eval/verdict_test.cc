#include "client/eval/verdict.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "client/eval/trajectory_eval.h"

namespace romap::eval::verdict_test {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;

TrajectoryReport GoodReport() {
  return {.extent_m = 1,
          .ate_rmse_m = 0.01,
          .motion = {.window_s = 1,
                     .window_correlation = 0.99,
                     .rotation_95_deg = 0.5,
                     .scale = 1,
                     .local_scales = {1, 1.02, 0.99},
                     .jumps = {.position_m = 0.02, .rotation_deg = 0.5}},
          .coverage = {.frames = 100, .tracked = 97}};
}

TEST(VerdictTest, GoodFiguresAreGood) {
  const Verdict verdict = Judge(GoodReport());
  EXPECT_EQ(FormatLine(verdict),
            "trajectory verdict: GOOD: ATE 1.0 % of the extent; translation correlation 0.990; rotation error 0.50 "
            "deg; 97.0 % of the frames tracked\n");
}

TEST(VerdictTest, TheWorstLevelDecidesAndNamesItsReasonsOnly) {
  TrajectoryReport report = GoodReport();
  report.coverage.tracked = 70;
  report.motion.jumps.rotation_deg = 8;
  EXPECT_EQ(Judge(report).level, VerdictLevel::kDegraded);
  EXPECT_THAT(Judge(report).reasons, SizeIs(2));
  report.motion.window_correlation = -0.9;
  const Verdict verdict = Judge(report);
  EXPECT_EQ(verdict.level, VerdictLevel::kWrong);
  EXPECT_THAT(FormatLine(verdict), AllOf(HasSubstr("correlation over 1 s is -0.90"), Not(HasSubstr("tracked"))));
}

TEST(VerdictTest, EachFigureCanMakeAMapWrong) {
  const auto level = [](auto change) {
    TrajectoryReport report = GoodReport();
    change(&report);
    return Judge(report).level;
  };
  using R = TrajectoryReport*;
  EXPECT_EQ(level([](R r) { r->motion.window_correlation = 0.2; }), VerdictLevel::kWrong);
  EXPECT_EQ(level([](R r) { r->motion.window_correlation.reset(); }), VerdictLevel::kWrong);
  EXPECT_EQ(level([](R r) { r->ate_rmse_m = 0.5; }), VerdictLevel::kWrong);
  EXPECT_EQ(level([](R r) { r->ate_rmse_m = std::numeric_limits<double>::quiet_NaN(); }), VerdictLevel::kWrong);
  EXPECT_EQ(level([](R r) { r->motion.rotation_95_deg = 40; }), VerdictLevel::kWrong);
  EXPECT_EQ(level([](R r) { r->motion.local_scales = {1, -1, 1}; }), VerdictLevel::kWrong);
  EXPECT_EQ(level([](R r) { r->motion.local_scales = {1, 2.5}; }), VerdictLevel::kWrong);
  EXPECT_EQ(level([](R r) { r->motion.jumps.position_m = 0.8; }), VerdictLevel::kWrong);
  EXPECT_EQ(level([](R r) { r->motion.jumps.rotation_deg = 90; }), VerdictLevel::kWrong);
  EXPECT_EQ(level([](R r) { r->coverage.tracked = 10; }), VerdictLevel::kWrong);
}

TEST(VerdictTest, TranslationIsNotJudgedIfTheTrueCameraHardlyMoves) {
  TrajectoryReport report = GoodReport();
  report.extent_m = 0.005;
  report.motion.window_correlation = 0;
  EXPECT_EQ(Judge(report).level, VerdictLevel::kGood);
  EXPECT_THAT(FormatLine(Judge(report)), HasSubstr("translation not judged"));
  report.motion.rotation_95_deg = 40;
  EXPECT_EQ(Judge(report).level, VerdictLevel::kWrong);
}

}  // namespace romap::eval::verdict_test
