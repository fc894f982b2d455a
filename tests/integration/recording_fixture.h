#pragma once

// Maps a copy of one sound sequence that a test has changed, with the built program.

#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "client/files/mesh_file.h"
#include "client/synth/synth.h"
#include "tests/integration/quick_run.h"
#include "tests/support/recording.h"
#include "tests/support/subprocess.h"

namespace romap::recordings {

inline constexpr int kFrames = 60;
inline constexpr int kObjects = 4;

// The result of `romap run`.
struct RunResult {
  testing_support::ProcessResult process;
  nlohmann::json summary;
  nlohmann::json cuboids;
  std::string dir;

  size_t objects() const { return summary["objects"].size(); }
  std::vector<std::string> Classes() const {
    std::vector<std::string> classes;
    for (const auto& object : summary["objects"]) classes.push_back(object["class"]);
    std::sort(classes.begin(), classes.end());
    return classes;
  }
  std::vector<std::string> Codes() const {
    std::vector<std::string> codes;
    for (const auto& diagnostic : summary["diagnostics"]) codes.push_back(diagnostic["code"]);
    return codes;
  }
  // Of the codes with a severity above info.
  std::vector<std::string> Warnings() const {
    std::vector<std::string> codes;
    for (const auto& diagnostic : summary["diagnostics"]) {
      if (diagnostic["severity"] != "info") codes.push_back(diagnostic["code"]);
    }
    return codes;
  }
  // By file name; empty, with a test failure, if there are none.
  std::map<std::string, files::MeshFile> Meshes() const {
    auto meshes = files::ReadMeshFolder(dir + "/objects");
    EXPECT_TRUE(meshes.ok()) << meshes.status();
    return meshes.ok() ? *std::move(meshes) : std::map<std::string, files::MeshFile>();
  }
  // Number of different x coordinates in the meshes' files.
  size_t DistinctX() const {
    std::set<double> distinct;
    for (const auto& [name, mesh] : Meshes()) {
      for (size_t k = 0; k < mesh.mesh.vertices.size(); ++k) distinct.insert(mesh.Position(k).x());
    }
    return distinct.size();
  }
  // Mean over the colors of all meshes, 0 to 255.
  double MeanBrightness() const {
    const auto meshes = files::ReadMeshFolder(dir + "/objects");
    EXPECT_TRUE(meshes.ok()) << meshes.status();
    double sum = 0, count = 0;
    for (const auto& [name, mesh] : *meshes) {
      for (const Rgb8& color : mesh.mesh.colors) sum += (color[0] + color[1] + color[2]) / 3.0;
      count += static_cast<double>(mesh.mesh.colors.size());
    }
    return sum / count;
  }
  double Mean(const char* figure) const { return summary["evaluation"]["objects"]["mean"][figure]; }
};

class RecordingTest : public ::testing::Test {
 protected:
  void SetUp() override { recording_.emplace(SoundSequence(), folder_ / "recording"); }

  const testing_support::Recording& recording() const { return *recording_; }
  const testing_support::TemporaryFolder& folder() const { return folder_; }

  // Replaces every pose of the sequence.
  template <class Change>
  void ChangePoses(const Change& change) const {
    std::vector<files::StampedPose> poses = recording().Poses();
    for (files::StampedPose& pose : poses) pose.T_world_camera = change(pose.T_world_camera);
    recording().WritePoses(poses);
  }

  // Maps the objects, but hardly trains them.
  RunResult Run(std::vector<std::string> options = {}) {
    options.insert(options.end(), {"--max-training", testing_support::kUnderSanitizer ? "90" : "1"});
    return RunTrained(options);
  }

  RunResult RunTrained(const std::vector<std::string>& options = {}) { return RunOn(recording().dir(), options); }

  // The same with another recording.
  RunResult RunOn(const std::string& source, const std::vector<std::string>& options) {
    std::vector<std::string> command = {ROMAP_CLIENT,    "run",     source,         "--out",
                                        folder_ / "map", "--local", "--no-pictures"};
    command.insert(command.end(), options.begin(), options.end());
    RunResult result;
    result.process = testing_support::RunProcess(integration::Quick(command));
    result.dir = folder_ / "map";
    if (std::ifstream in(result.dir + "/summary.json"); in) result.summary = nlohmann::json::parse(in);
    if (std::ifstream in(result.dir + "/cuboids.json"); in) result.cuboids = nlohmann::json::parse(in);
    return result;
  }

  // All objects of the sound sequence, and no others.
  static void ExpectTheMap(const RunResult& result) {
    ASSERT_EQ(result.process.exit_code, 0) << result.process.err;
    EXPECT_EQ(result.objects(), static_cast<size_t>(kObjects)) << result.process.out;
  }

  // The same, with shapes as good as those of the sound sequence, within the tolerance of so few frames.
  static void ExpectTheShapes(const RunResult& result) {
    ExpectTheMap(result);
    if (!integration::kShapesAreGood) return;
    EXPECT_LT(result.Mean("comp_seen_cm"), 0.5) << result.process.out;
    EXPECT_LT(result.Mean("acc_cm"), 0.7) << result.process.out;
  }

 private:
  // Rendered once for all tests of the process, or by CTest for all processes (ROMAP_SOUND_SEQUENCE).
  static std::string SoundSequence() {
    if (const char* rendered_before = std::getenv("ROMAP_SOUND_SEQUENCE")) return rendered_before;
    static const testing_support::TemporaryFolder* const folder = [] {
      static const testing_support::TemporaryFolder rendered;
      synth::SynthOptions options;
      options.seed = 1;
      options.objects = kObjects;
      options.frames = kFrames;
      options.width_px = 320;
      options.height_px = 240;
      EXPECT_TRUE(synth::MakeSequence(options, rendered / "base").ok());
      return &rendered;
    }();
    return *folder / "base";
  }

  testing_support::TemporaryFolder folder_;
  std::optional<testing_support::Recording> recording_;
};

}  // namespace romap::recordings
