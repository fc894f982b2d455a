// Compares the figures with those of the reference evaluators (Python scripts eval_objects.py, eval_boxes.py and
// eval_traj.py in ROMAP_TOOLS_DIR) on synthetic files and, with ROMAP_DATA_DIR, on the ground truth of a sequence.
// The evaluators sample meshes with different random numbers, so figures of meshes agree only within the sampling
// noise.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "client/eval/eval.h"
#include "client/files/mesh_file.h"
#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval::reference_tools_test {

using eval_world::Moved;
using eval_world::TempFolder;
using nlohmann::ordered_json;

struct Tolerance {
  double relative;
  double absolute;          // lengths [cm or m], angles [deg], shares and factors
  double absolute_percent;  // completion ratios [%]
};
constexpr Tolerance kDeterministic{5e-4, 1e-5, 1e-5};
constexpr Tolerance kSampled{0.03, 0.05, 1.0};

// Expects that `actual` contains every number of `expected` with the same value.
void ExpectAgrees(const ordered_json& actual, const ordered_json& expected, const Tolerance& tolerance,
                  const std::string& where) {
  if (expected.is_object()) {
    for (const auto& [name, value] : expected.items()) {
      if (name == "settings" || name == "icp_iterations") continue;
      const std::string key = name == "centre_cm" ? "center_cm" : name;
      ASSERT_TRUE(actual.contains(key)) << where << "/" << key;
      ExpectAgrees(actual[key], value, tolerance, where + "/" + key);
    }
  } else if (expected.is_array()) {
    ASSERT_EQ(actual.size(), expected.size()) << where;
    for (size_t k = 0; k < expected.size(); ++k) {
      ExpectAgrees(actual[k], expected[k], tolerance, fmt::format("{}[{}]", where, k));
    }
  } else if (expected.is_number()) {
    ASSERT_TRUE(actual.is_number()) << where;
    const double value = expected.get<double>();
    const bool percent = where.find("/ratio") != std::string::npos;
    EXPECT_NEAR(actual.get<double>(), value,
                tolerance.relative * std::abs(value) + (percent ? tolerance.absolute_percent : tolerance.absolute))
        << where;
  } else {
    EXPECT_EQ(actual, expected) << where;
  }
}

class ReferenceToolsTest : public testing::Test {
 protected:
  void SetUp() override {
    const char* tools_dir = std::getenv("ROMAP_TOOLS_DIR");
    if (tools_dir == nullptr) GTEST_SKIP() << "ROMAP_TOOLS_DIR is not set";
    if (std::system("/usr/bin/python3 -c 'import numpy, scipy' 2>/dev/null") != 0) {
      GTEST_SKIP() << "the reference tools need python3-numpy and python3-scipy";
    }
    tools_dir_ = tools_dir;
  }

  // Runs a tool and returns the JSON that it writes.
  ordered_json Run(const std::string& tool, const std::string& arguments) {
    const std::string command = fmt::format("/usr/bin/python3 '{}/{}' {} --json '{}' > '{}' 2>&1", tools_dir_, tool,
                                            arguments, folder_ / "out.json", folder_ / "out.log");
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    std::ifstream file(folder_ / "out.json");
    return ordered_json::parse(file, nullptr, /*allow_exceptions=*/false);
  }

  // Compares EvaluateObjects with eval_objects.py on the same files and options.
  void CompareObjects(const ObjectsEvalOptions& options, const std::string& more) {
    const auto report = EvaluateObjects(options);
    ASSERT_TRUE(report.ok()) << report.status();
    const ordered_json expected = Run(
        "eval_objects.py", fmt::format("--pred '{}' --gt '{}' --align {} --samples {} {}", options.predicted_dir,
                                       options.ground_truth_dir, ToString(options.alignment), options.samples, more));
    ExpectAgrees(ToJson(*report), expected, kSampled, "objects");
  }

  eval_world::TempFolder folder_;
  std::string tools_dir_;
};

TEST_F(ReferenceToolsTest, AgreeOnMeshes) {
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(0.05, Eigen::Vector3d(1, 2, 3).normalized()));
  const Sim3<World, World> error(1.03, rotation, Eigen::Vector3d(0.004, -0.003, 0.005));
  ASSERT_TRUE(files::WritePly(folder_ / "gt/ball.ply", eval_world::Sphere(0.1, {0, 0, 0})).ok());
  ASSERT_TRUE(files::WritePly(folder_ / "gt/brick.ply", eval_world::Box({0.1, 0.07, 0.05}, {0, 0.4, 0})).ok());
  ASSERT_TRUE(files::WritePly(folder_ / "pred/1.ply", Moved(eval_world::Sphere(0.1, {0, 0, 0}, 60), error)).ok());
  ASSERT_TRUE(
      files::WritePly(folder_ / "pred/2.ply", Moved(eval_world::Box({0.1, 0.07, 0.05}, {0, 0.4, 0}), error)).ok());
  ASSERT_TRUE(files::WritePly(folder_ / "pred/3.ply", eval_world::Sphere(0.1, {5, 5, 5})).ok());
  ObjectsEvalOptions options;
  options.predicted_dir = folder_ / "pred";
  options.ground_truth_dir = folder_ / "gt";
  options.samples = 30000;
  for (const Alignment alignment : {Alignment::kNone, Alignment::kSe3, Alignment::kSim3}) {
    options.alignment = alignment;
    CompareObjects(options, "");
  }
}

TEST_F(ReferenceToolsTest, AgreeOnTrajectories) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.01);
  std::vector<files::StampedPose> estimated = Moved(eval_world::Orbit(), eval_world::OtherWorld());
  for (files::StampedPose& pose : estimated) {
    pose.timestamp_ns += 3'000'000;
    pose.T_world_camera = {pose.T_world_camera.rotation(),
                           Eigen::Vector3d(pose.T_world_camera.translation() +
                                           Eigen::Vector3d(noise(random), noise(random), noise(random)))};
  }
  estimated.resize(150);
  ASSERT_TRUE(files::WriteTum(folder_ / "est.txt", estimated).ok());
  ASSERT_TRUE(files::WriteTum(folder_ / "gt.txt", eval_world::Orbit()).ok());
  for (const Alignment alignment : {Alignment::kNone, Alignment::kSe3, Alignment::kSim3}) {
    const auto report = EvaluateTrajectory({.estimated = folder_ / "est.txt",
                                            .ground_truth = folder_ / "gt.txt",
                                            .alignment = alignment,
                                            .max_dt_s = 0.01});
    ASSERT_TRUE(report.ok()) << report.status();
    const ordered_json expected =
        Run("eval_traj.py", fmt::format("--est '{}' --gt '{}' --align {} --max-dt 0.01", folder_ / "est.txt",
                                        folder_ / "gt.txt", ToString(alignment)));
    ExpectAgrees(ToJson(*report), expected, kDeterministic, "trajectory");
  }
}

TEST_F(ReferenceToolsTest, AgreeOnBoxes) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-1, 1);
  files::ObjectsYaml truth, predicted;
  truth.up_world = Eigen::Vector3d(0.02, -0.05, 1).normalized();
  for (int k = 1; k <= 6; ++k) {
    const Eigen::Vector3d center(k, uniform(random), uniform(random));
    const Eigen::Vector3d half(0.3 + 0.1 * uniform(random), 0.2 + 0.1 * uniform(random), 0.3 + 0.1 * uniform(random));
    const double yaw_rad = 3 * uniform(random);
    truth.objects.push_back(eval_world::UprightCuboid(k, center, yaw_rad, half));
    if (k == 4) continue;
    const Eigen::Vector3d shift = 0.1 * Eigen::Vector3d(uniform(random), uniform(random), uniform(random));
    predicted.objects.push_back(eval_world::UprightCuboid(10 + k, center + shift, yaw_rad + 2 * uniform(random),
                                                          (1 + 0.2 * uniform(random)) * half));
  }
  predicted.objects.push_back(eval_world::UprightCuboid(99, {-20, 0, 0}, 0, {1, 1, 1}));
  ASSERT_TRUE(files::WriteObjects(folder_ / "gt.yaml", truth).ok());
  for (const std::string name : {"cuboids.json", "cuboids.yaml"}) {
    ASSERT_TRUE(files::WriteObjects(folder_ / name, predicted).ok());
    BoxesEvalOptions options;
    options.predicted = folder_ / name;
    options.ground_truth = folder_ / "gt.yaml";
    const auto report = EvaluateBoxes(options);
    ASSERT_TRUE(report.ok()) << report.status();
    const ordered_json expected =
        Run("eval_boxes.py", fmt::format("--pred '{}' --gt '{}'", options.predicted, options.ground_truth));
    ExpectAgrees(ToJson(*report), expected, kDeterministic, "boxes");
  }
}

TEST_F(ReferenceToolsTest, AgreeOnASequenceWithMasksAndDepth) {
  const char* data_dir = std::getenv("ROMAP_DATA_DIR");
  if (data_dir == nullptr) GTEST_SKIP() << "ROMAP_DATA_DIR is not set";
  const std::string room = std::string(data_dir) + "/cube_diorama_room";
  const auto truth = files::ReadMeshFolder(room + "/gt");
  ASSERT_TRUE(truth.ok()) << truth.status();
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, 0.003f);
  for (const auto& [name, file] : *truth) {
    // A noisy mesh: small triangles scattered around the true points.
    Mesh mesh;
    for (size_t k = 0; k < file.mesh.vertices.size(); k += 9) {
      const Eigen::Vector3f p = file.mesh.vertices[k] + Eigen::Vector3f(noise(random), noise(random), noise(random));
      const uint32_t first = static_cast<uint32_t>(mesh.vertices.size());
      mesh.vertices.insert(mesh.vertices.end(),
                           {p, p + Eigen::Vector3f(0.003f, 0, 0), p + Eigen::Vector3f(0, 0.002f, 0.002f)});
      mesh.triangles.push_back({first, first + 1, first + 2});
    }
    ASSERT_TRUE(files::WritePly(folder_ / ("pred/" + name + ".ply"), mesh).ok());
  }
  ObjectsEvalOptions options;
  options.predicted_dir = folder_ / "pred";
  options.ground_truth_dir = room + "/gt";
  options.dataset_dir = room;
  options.dataset_every = 10;
  options.ignore_inferred = true;
  options.alignment = Alignment::kNone;
  CompareObjects(options, fmt::format("--no-cap --dataset '{}' --dataset-every 10", room));
}

}  // namespace romap::eval::reference_tools_test
