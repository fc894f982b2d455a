#include "client/eval/objects_eval.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <opencv2/imgcodecs.hpp>

#include "client/files/camera_yaml.h"
#include "client/files/text_file.h"
#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval::objects_eval_test {

using eval_world::Box;
using eval_world::SamplingFloor_cm;
using eval_world::Sphere;
using eval_world::TempFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr size_t kSamples = 30000;
const Eigen::Vector3d kBoxCenter(0, 0.6, 0);
const Eigen::Vector3d kBoxHalf(0.1, 0.07, 0.05);
const double kSphereArea_cm2 = 4 * std::numbers::pi * 100;
const double kBoxArea_cm2 = 8 * (70 + 50 + 35);

class ObjectsEvalTest : public testing::Test {
 protected:
  ObjectsEvalTest() {
    options_.predicted_dir = folder_ / "pred";
    options_.ground_truth_dir = folder_ / "gt";
    options_.samples = kSamples;
    options_.icp_points = 5000;
    options_.alignment = Alignment::kNone;
  }

  void Put(const std::string& name, const Mesh& mesh, const std::map<std::string, std::vector<double>>& scalars = {}) {
    const absl::Status status = files::WritePly(folder_ / (name + ".ply"), mesh, scalars);
    EXPECT_TRUE(status.ok()) << status;
  }
  // The match of the only true object.
  ObjectMatch EvaluateOne() {
    const auto report = EvaluateObjects(options_);
    EXPECT_TRUE(report.ok()) << report.status();
    return report.ok() && report->rows[0].match ? *report->rows[0].match : ObjectMatch{};
  }
  std::string Error() { return std::string(EvaluateObjects(options_).status().message()); }

  eval_world::TempFolder folder_;
  ObjectsEvalOptions options_;
};

TEST_F(ObjectsEvalTest, AMeshComparedWithItselfHasTheErrorOfSampling) {
  Put("gt/sphere", eval_world::Sphere(0.1, {0, 0, 0}));
  Put("gt/box", eval_world::Box(kBoxHalf, kBoxCenter));
  Put("pred/object_7", eval_world::Box(kBoxHalf, kBoxCenter));
  Put("pred/object_8", eval_world::Sphere(0.1, {0, 0, 0}, 90));
  const auto report = EvaluateObjects(options_);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->rows[0].match->predicted, "object_7");
  EXPECT_EQ(report->rows[1].match->predicted, "object_8");
  EXPECT_NEAR(report->rows[0].match->figures.accuracy_cm, eval_world::SamplingFloor_cm(kBoxArea_cm2, kSamples), 0.01);
  EXPECT_NEAR(report->rows[1].match->figures.completion_cm, eval_world::SamplingFloor_cm(kSphereArea_cm2, kSamples),
              0.01);
  EXPECT_NEAR(*report->mean.accuracy_cm,
              (report->rows[0].match->figures.accuracy_cm + report->rows[1].match->figures.accuracy_cm) / 2, 1e-12);
}

TEST_F(ObjectsEvalTest, MeasuresASphereThatIsFiveMillimetersTooLarge) {
  Put("gt/sphere", eval_world::Sphere(0.1, {0, 0, 0}));
  Put("pred/a", eval_world::Sphere(0.105, {0, 0, 0}));
  const ObjectMatch match = EvaluateOne();
  EXPECT_NEAR(match.figures.accuracy_cm, 0.5, 0.02);
  EXPECT_NEAR(match.figures.completion_cm, 0.5, 0.02);
  EXPECT_EQ(match.figures.ratios[0].all_percent, 0) << "< 0.4 cm";
  EXPECT_EQ(match.figures.ratios[1].all_percent, 100) << "< 1 cm";
  options_.alignment = Alignment::kSim3;
  const ObjectMatch aligned = EvaluateOne();
  EXPECT_NEAR(aligned.icp->scale, 1 / 1.05, 2e-3);
  EXPECT_NEAR(aligned.figures.accuracy_cm, eval_world::SamplingFloor_cm(kSphereArea_cm2, kSamples), 0.02);
  options_.alignment = Alignment::kSe3;
  EXPECT_EQ(EvaluateOne().icp->scale, 1);
}

TEST_F(ObjectsEvalTest, IcpRecoversScaleRotationAndTranslation) {
  const double angle_rad = 0.054;
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(angle_rad, Eigen::Vector3d(0.02, -0.03, 0.04).normalized()));
  const Sim3<World, World> about_center(
      1.06, rotation, kBoxCenter - 1.06 * (rotation * kBoxCenter) + Eigen::Vector3d(0.008, -0.006, 0.005));
  Put("gt/box", eval_world::Box(kBoxHalf, kBoxCenter));
  Put("pred/a", eval_world::Moved(eval_world::Box(kBoxHalf, kBoxCenter), about_center));
  options_.alignment = Alignment::kSim3;
  const ObjectMatch match = EvaluateOne();
  EXPECT_NEAR(match.icp->scale, 1 / 1.06, 3e-3);
  EXPECT_NEAR(match.icp->rotation_deg, angle_rad * 180 / std::numbers::pi, 0.2);
  EXPECT_NEAR(match.figures.accuracy_cm, eval_world::SamplingFloor_cm(kBoxArea_cm2, kSamples), 0.03);
}

TEST_F(ObjectsEvalTest, HalfASphereIsHalfComplete) {
  Put("gt/sphere", eval_world::Sphere(0.1, {0, 0, 0}));
  Put("pred/a", eval_world::Sphere(0.1, {0, 0, 0}, 240, /*min_z=*/0));
  const ObjectMatch match = EvaluateOne();
  // At angle a below the equator the distance to the rim is 2 r sin(a / 2). Mean over the sphere, with 0 for the upper
  // half.
  double integral_cm = 0;
  const int steps = 10000;
  for (int k = 0; k < steps; ++k) {
    const double a = (k + 0.5) / steps * std::numbers::pi / 2;
    integral_cm += 20 * std::sin(a / 2) * std::cos(a) * std::numbers::pi / 2 / steps / 2;
  }
  EXPECT_NEAR(match.figures.completion_cm, integral_cm, 0.1);
  EXPECT_NEAR(match.figures.ratios[1].all_percent, 100 * (0.5 + 0.5 * std::sin(2 * std::asin(0.05))), 1.5);
  EXPECT_NEAR(match.figures.accuracy_cm, eval_world::SamplingFloor_cm(kSphereArea_cm2, kSamples), 0.02);
}

TEST_F(ObjectsEvalTest, SeenFiguresIgnoreUnseenPointsAndInferredPointsCanBeExcluded) {
  Mesh cloud = eval_world::Sphere(0.1, {0, 0, 0}, 300);
  cloud.triangles.clear();
  std::vector<double> seen, source;
  for (const Eigen::Vector3f& vertex : cloud.vertices) {
    seen.push_back(vertex.z() >= 0);
    source.push_back(vertex.z() < -0.05 ? 2 : 0);
  }
  Put("gt/sphere", cloud, {{"seen", seen}, {"source", source}});
  Mesh predicted = eval_world::Sphere(0.1, {0, 0, 0}, 240);
  for (Eigen::Vector3f& vertex : predicted.vertices) vertex *= vertex.z() < -1e-6f ? 1.2f : 1.f;
  Put("pred/a", predicted);
  const ObjectMatch match = EvaluateOne();
  EXPECT_NEAR(*match.figures.accuracy_seen_cm, 0, 0.1);
  EXPECT_NEAR(match.figures.accuracy_cm, 2 * 1.44 / 2.44, 0.06)
      << "the lower half is 2 cm too large and has 1.44 times the area";
  EXPECT_NEAR(match.true_seen_share, 0.5, 0.01);
  options_.ignore_inferred = true;
  EXPECT_GT(EvaluateOne().true_seen_share, 0.6) << "of the measured points";
}

TEST_F(ObjectsEvalTest, TransformsMeshesByTheTrajectories) {
  const Sim3<World, World> other = eval_world::OtherWorld();
  Put("gt/box", eval_world::Box(kBoxHalf, kBoxCenter));
  Put("pred/a", eval_world::Moved(eval_world::Box(kBoxHalf, kBoxCenter), other));
  EXPECT_THAT(Error(), HasSubstr("if the world frames differ"));
  options_.estimated_trajectory = folder_ / "est.txt";
  EXPECT_THAT(Error(), HasSubstr("both or neither"));
  options_.true_trajectory = folder_ / "gt.txt";
  ASSERT_TRUE(files::WriteTum(options_.true_trajectory, eval_world::Orbit()).ok());
  ASSERT_TRUE(files::WriteTum(options_.estimated_trajectory, eval_world::Moved(eval_world::Orbit(), other)).ok());
  EXPECT_NEAR(EvaluateOne().figures.accuracy_cm, eval_world::SamplingFloor_cm(kBoxArea_cm2, kSamples), 0.01);
}

TEST_F(ObjectsEvalTest, CountsMissingAndExtraMeshes) {
  Put("gt/box", eval_world::Box(kBoxHalf, kBoxCenter));
  Put("gt/far", eval_world::Sphere(0.1, {10, 0, 0}));
  Put("pred/a", eval_world::Box(kBoxHalf, kBoxCenter));
  Put("pred/false_object", eval_world::Sphere(0.05, {-7, 0, 0}));
  const auto report = EvaluateObjects(options_);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->matched, 1u);
  EXPECT_FALSE(report->rows[1].match.has_value());
  EXPECT_THAT(report->extra, ElementsAre("false_object"));
  EXPECT_NEAR(report->mean.ratios[1].all_percent_with_missing, *report->mean.ratios[1].all_percent / 2, 1e-9);
}

TEST_F(ObjectsEvalTest, NamesTheInvalidInput) {
  options_.predicted_dir = folder_ / "nowhere_at_all/x";
  options_.ground_truth_dir = folder_ / "gt/";
  EXPECT_THAT(Error(), HasSubstr("no .ply or .obj files"));
  Put("gt/box", eval_world::Box(kBoxHalf, kBoxCenter));
  EXPECT_THAT(Error(), HasSubstr("nowhere_at_all/x: cannot read: No such file or directory"));
  std::ofstream(folder_ / "pred/broken.ply") << "ply\nformat ascii 1.0\n";
  options_.predicted_dir = folder_ / "pred";
  EXPECT_THAT(Error(), HasSubstr("broken.ply: the PLY header has no end_header"));
  options_.samples = 10;
  EXPECT_THAT(Error(), HasSubstr("samples (10)"));
  options_.samples = kSamples;
  options_.thresholds_cm = {-1};
  EXPECT_THAT(Error(), HasSubstr("threshold is -1 cm"));
}

// A camera 1 m above a plate sees its upper side. The mask excludes the half with x < 0.
class ObjectsEvalWithMasksTest : public ObjectsEvalTest {
 protected:
  ObjectsEvalWithMasksTest() {
    const std::string root = folder_ / "set";
    const files::CameraYaml camera{{64, 48, 100, 100, 31.5, 23.5, {}}, 10, 0.001};
    EXPECT_TRUE(files::WriteCameraYaml(folder_ / "set/camera.yaml", camera).ok());
    for (const char* list : {"rgb", "mask", "depth"}) {
      EXPECT_TRUE(
          files::WriteFile(folder_ / ("set/" + std::string(list) + ".txt"), "0.0 " + std::string(list) + ".png\n")
              .ok());
    }
    cv::Mat labels = cv::Mat::zeros(48, 64, CV_8UC1);
    labels.colRange(32, 64) = 3;
    cv::imwrite(folder_ / "set/rgb.png", cv::Mat::zeros(48, 64, CV_8UC3));
    cv::imwrite(folder_ / "set/mask.png", labels);
    cv::imwrite(folder_ / "set/depth.png", cv::Mat(48, 64, CV_16UC1, cv::Scalar(1000)));
    files::ObjectRecord plate = eval_world::UprightCuboid(3, {0, 0, 0}, 0, {0.1, 0.1, 0.02});
    plate.name = "plate";
    EXPECT_TRUE(files::WriteObjects(folder_ / "set/objects.yaml", {.objects = {plate}}).ok());
    const Eigen::Quaterniond down(Eigen::AngleAxisd(std::numbers::pi, Eigen::Vector3d::UnitX()));
    EXPECT_TRUE(files::WriteTum(folder_ / "set/groundtruth.txt",
                                std::vector<files::StampedPose>{{0, {down, Eigen::Vector3d(0, 0, 1)}}})
                    .ok());
    options_.dataset_dir = root;
    options_.dataset_every = 1;
  }
};

TEST_F(ObjectsEvalWithMasksTest, PointsInTheMaskNearTheTrueDepthCountAsSeen) {
  Mesh cloud = eval_world::Box({0.1, 0.1, 0.05}, {0, 0, 0});
  cloud.triangles.clear();
  Put("gt/plate", cloud, {{"seen", std::vector<double>(8, 0)}});
  Mesh points;
  points.vertices = {{0.05f, 0, 0},        // in the mask, at the true depth
                     {0.05f, 0, -0.015f},  // 1.5 cm behind
                     {0.05f, 0, -0.04f},   // 4 cm behind
                     {-0.05f, 0, 0},       // not in the mask
                     {0.05f, 0, 2.f}};     // behind the camera
  Put("pred/a", points);
  options_.match_distance = 100;
  EXPECT_NEAR(EvaluateOne().predicted_seen_share, 2.0 / 5, 1e-12);
}

TEST_F(ObjectsEvalWithMasksTest, NamesATrueSurfaceWithoutAnObject) {
  Put("gt/bowl", eval_world::Box(kBoxHalf, {0, 0, 0}));
  Put("pred/a", eval_world::Box(kBoxHalf, {0, 0, 0}));
  EXPECT_THAT(Error(), HasSubstr("objects.yaml: no object named bowl"));
}

}  // namespace romap::eval::objects_eval_test
