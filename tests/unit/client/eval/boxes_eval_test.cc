#include "client/eval/boxes_eval.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "common/angles.h"
#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval::boxes_eval_test {

using eval_world::TempFolder;
using eval_world::UprightCuboid;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class BoxesEvalTest : public testing::Test {
 protected:
  BoxesEvalTest() { Write("gt.yaml", {First(), Second()}); }

  static files::ObjectRecord First() { return eval_world::UprightCuboid(1, {0, 0, 0}, 0.3, {0.1, 0.2, 0.05}); }
  static files::ObjectRecord Second() { return eval_world::UprightCuboid(2, {1, 0, 0.1}, -0.5, {0.15, 0.1, 0.2}); }

  void Write(const std::string& name, const std::vector<files::ObjectRecord>& objects) {
    EXPECT_TRUE(files::WriteObjects(folder_ / name, {.objects = objects}).ok());
  }
  absl::StatusOr<BoxesReport> Evaluate(const std::vector<files::ObjectRecord>& predicted) {
    Write("cuboids.json", predicted);
    BoxesEvalOptions options;
    options.predicted = folder_ / "cuboids.json";
    options.ground_truth = folder_ / "gt.yaml";
    return EvaluateBoxes(options);
  }

  eval_world::TempFolder folder_;
};

TEST_F(BoxesEvalTest, BoxesComparedWithThemselvesAreExactInAnyOrder) {
  const auto report = Evaluate({Second(), First()});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->matched, 2u);
  EXPECT_NEAR(report->iou_all, 1, 1e-7);
  EXPECT_EQ(report->rows[0].match->predicted, "1:b1");
  EXPECT_NEAR(report->center_cm, 0, 1e-6);
}

TEST_F(BoxesEvalTest, AShiftByHalfALengthGivesAnIouOfOneThird) {
  files::ObjectRecord moved =
      eval_world::UprightCuboid(1, 0.1 * Eigen::Vector3d(std::cos(0.3), std::sin(0.3), 0), 0.3, {0.1, 0.2, 0.05});
  const auto report = Evaluate({moved, Second()});
  EXPECT_NEAR(report->rows[0].match->iou, 1.0 / 3, 1e-7);
  EXPECT_NEAR(report->rows[0].match->center_cm, 10, 1e-6);
}

TEST_F(BoxesEvalTest, TheOverlapDoesNotDependOnTheOrigin) {
  const auto iou = [](const Eigen::Vector3d& origin) {
    const YawBox a{.center = origin, .yaw_rad = 0.3, .half_extents = {0.1, 0.2, 0.05}};
    YawBox b = a;
    b.center += Eigen::Vector3d(0.03, -0.02, 0.01);
    b.yaw_rad = 0.5;
    return IntersectionOverUnion(a, b);
  };
  EXPECT_NEAR(iou({500'000, -6'400'000, 100}), iou({0, 0, 0}), 1e-6);
}

TEST_F(BoxesEvalTest, AQuarterTurnWithSwappedSidesIsTheSameBox) {
  const auto report = Evaluate({eval_world::UprightCuboid(1, {0, 0, 0}, 0.3 + std::numbers::pi / 2, {0.2, 0.1, 0.05}),
                                eval_world::UprightCuboid(2, {1, 0, 0.1}, -0.5 + 10 * kRadPerDeg, {0.15, 0.1, 0.2})});
  const BoxFigures& turned = *report->rows[0].match;
  EXPECT_NEAR(turned.iou, 1, 1e-7);
  EXPECT_NEAR(turned.yaw_deg, 0, 1e-6);
  for (const double ratio : turned.size_ratio) EXPECT_NEAR(ratio, 1, 1e-7);
  EXPECT_NEAR(report->rows[1].match->yaw_deg, 10, 1e-6);
}

TEST_F(BoxesEvalTest, TenPercentTooLargeInAllDirectionsGivesTheVolumeRatio) {
  EXPECT_NEAR(Evaluate({eval_world::UprightCuboid(1, {0, 0, 0}, 0.3, {0.11, 0.22, 0.055})})->iou_matched, 1 / 1.331,
              1e-7);
}

TEST_F(BoxesEvalTest, CountsMissingAndExtraBoxes) {
  const auto report = Evaluate({First(), eval_world::UprightCuboid(9, {50, 0, 0}, 0, {1, 1, 1})});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_FALSE(report->rows[1].match.has_value());
  EXPECT_NEAR(report->iou_matched, 1, 1e-7);
  EXPECT_NEAR(report->iou_all, 0.5, 1e-7);
  EXPECT_THAT(report->extra, ElementsAre("b9"));
}

TEST_F(BoxesEvalTest, TransformsBoxesByTheTrajectories) {
  const Sim3<World, World> other = eval_world::OtherWorld();
  std::vector<files::ObjectRecord> moved{First(), Second()};
  for (files::ObjectRecord& object : moved) {
    object.T_world_object = other.Moved(object.T_world_object);
    object.half_extents *= other.scale();
  }
  EXPECT_THAT(std::string(Evaluate(moved).status().message()), HasSubstr("if the world frames differ"));
  ASSERT_TRUE(files::WriteTum(folder_ / "gt.txt", eval_world::Orbit()).ok());
  ASSERT_TRUE(files::WriteTum(folder_ / "est.txt", eval_world::Moved(eval_world::Orbit(), other)).ok());
  BoxesEvalOptions options;
  options.predicted = folder_ / "cuboids.json";
  options.ground_truth = folder_ / "gt.yaml";
  options.estimated_trajectory = folder_ / "est.txt";
  EXPECT_THAT(std::string(EvaluateBoxes(options).status().message()), HasSubstr("both or neither"));
  options.true_trajectory = folder_ / "gt.txt";
  const auto report = EvaluateBoxes(options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_NEAR(report->iou_all, 1, 1e-5);
  EXPECT_NEAR(report->trajectory_scale, 1 / 0.37, 1e-6);
}

TEST_F(BoxesEvalTest, RejectsAnEmptyFile) {
  EXPECT_THAT(std::string(Evaluate({}).status().message()), HasSubstr("contains no objects"));
}

TEST(IntersectionOverUnionTest, AgreesWithMonteCarlo) {
  const YawBox a{{0, 0, 0}, -0.5, {0.15, 0.1, 0.2}, 0};
  const YawBox b{{0.04, -0.03, 0.05}, 0.2, {0.12, 0.13, 0.15}, 0};
  const auto inside = [](const YawBox& box, const Eigen::Vector3d& p) {
    const Eigen::AngleAxisd yaw(-box.yaw_rad, Eigen::Vector3d::UnitZ());
    return ((yaw * (p - box.center)).cwiseAbs().array() < box.half_extents.array()).all();
  };
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-0.3, 0.3);
  int both = 0, either = 0;
  for (int k = 0; k < 300000; ++k) {
    const Eigen::Vector3d p(uniform(random), uniform(random), uniform(random));
    const bool in_a = inside(a, p), in_b = inside(b, p);
    both += in_a && in_b;
    either += in_a || in_b;
  }
  EXPECT_NEAR(IntersectionOverUnion(a, b), static_cast<double>(both) / either, 0.01);
  EXPECT_EQ(IntersectionOverUnion(a, {{5, 0, 0}, 0, {1, 1, 1}, 0}), 0);
}

TEST(MakeUprightTest, UsesTheAxisClosestToUpAndReportsTheTilt) {
  // A box on its side: its x axis points up, tilted by 5 degrees.
  const Eigen::Matrix3d rotation = (Eigen::AngleAxisd(5 * kRadPerDeg, Eigen::Vector3d::UnitX()) *
                                    Eigen::AngleAxisd(-90 * kRadPerDeg, Eigen::Vector3d::UnitY()))
                                       .toRotationMatrix();
  const YawBox box = MakeUpright(rotation, {0, 0, 0}, {3, 1, 2});
  EXPECT_EQ(box.half_extents.z(), 3);
  EXPECT_NEAR(box.tilt_deg, 5, 1e-9);
}

}  // namespace romap::eval::boxes_eval_test
