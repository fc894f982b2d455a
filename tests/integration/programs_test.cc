// Runs the built programs like a user: a synthetic sequence through server and client, and invalid input.

#include <gmock/gmock.h>
#include <signal.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <regex>

#include "client/eval/trajectory_eval.h"
#include "client/synth/synth.h"
#include "tests/integration/quick_run.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::programs_test {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;
using testing_support::BackgroundProcess;
using testing_support::ProcessResult;
using testing_support::RunProcess;
using testing_support::TemporaryFolder;

namespace fs = std::filesystem;

testing_support::ProcessResult Romap(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), ROMAP_CLIENT);
  return testing_support::RunProcess(arguments);
}

// Maps a sequence.
testing_support::ProcessResult MapSequence(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "run");
  return Romap(integration::Quick(arguments));
}

nlohmann::json ReadJson(const std::string& path) { return nlohmann::json::parse(std::ifstream(path)); }

synth::SynthOptions SmallScene() {
  synth::SynthOptions options;
  options.seed = 3;
  options.objects = 3;
  options.frames = 60;
  options.width_px = 320;
  options.height_px = 240;
  options.permute_labels = true;
  return options;
}

void MakeSmallSequence(const std::string& dir) { ASSERT_TRUE(synth::MakeSequence(SmallScene(), dir).ok()); }

// For tests that end before anything is mapped.
void MakeTinySequence(const std::string& dir) {
  const synth::SynthOptions options{.seed = 3, .objects = 1, .frames = 15, .width_px = 80, .height_px = 60};
  ASSERT_TRUE(synth::MakeSequence(options, dir).ok());
}

size_t CountFiles(const std::string& folder, const std::string& extension) {
  return std::count_if(fs::directory_iterator(folder), fs::directory_iterator(),
                       [&](const auto& entry) { return entry.path().extension() == extension; });
}

void ExpectMapOfThree(const std::string& out) {
  const nlohmann::json summary = ReadJson(out + "/summary.json");
  EXPECT_EQ(summary["frames"]["accepted"], 60);
  EXPECT_EQ(summary["objects"].size(), 3u) << summary.dump(1);
  const nlohmann::json& objects = summary["evaluation"]["objects"]["mean"];
  if (integration::kShapesAreGood) {
    EXPECT_LT(objects["comp_seen_cm"].get<double>(), 0.8) << summary["evaluation"].dump(1);
  }
  EXPECT_EQ(ReadJson(out + "/cuboids.json")["objects"].size(), 3u);
  EXPECT_EQ(CountFiles(out + "/objects", ".ply"), 3u);
  EXPECT_EQ(CountFiles(out + "/objects", ".glb"), 3u);
  EXPECT_GE(CountFiles(out + "/pictures", ".png"), 2u)
      << "the overview, and objects that are completely visible in some frame";
  EXPECT_EQ(CountFiles(out + "/pictures", ".jpg"), 6u) << "cuboids in frames";
  EXPECT_GT(fs::file_size(out + "/trajectory.txt"), 1000u);
}

TEST(ProgramsTest, ServerAndClientMapASequence) {
  const testing_support::TemporaryFolder folder;
  MakeSmallSequence(folder / "sequence");
  testing_support::BackgroundProcess server(
      integration::Quick({ROMAP_SERVER, "--ephemeral", "--listen", "127.0.0.1:0", "--http", ""}));
  const std::string address = server.WaitForLine("romap-server listening on ");
  ASSERT_NE(address, "");

  const testing_support::ProcessResult run = Romap({"run", folder / "sequence", "--server", address, "--out",
                                                    folder / "map", "--keep-session", "--name", "three objects"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  ExpectMapOfThree(folder / "map");

  const testing_support::ProcessResult sessions = Romap({"sessions", "--server", address});
  EXPECT_THAT(sessions.out, AllOf(HasSubstr("finished"), HasSubstr("three objects")));
  const std::string id = ReadJson(folder / "map/summary.json")["session"];
  const testing_support::ProcessResult exported =
      Romap({"export", id, "--server", address, "--out", folder / "export"});
  EXPECT_EQ(exported.exit_code, 0) << exported.err;
  EXPECT_EQ(CountFiles(folder / "export/objects", ".ply"), 3u);
  EXPECT_THAT(Romap({"sessions", "--server", address, "--delete", id}).out, HasSubstr("(no sessions)"));

  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait().exit_code, 0);
}

TEST(ProgramsTest, TracksTheCameraFromImagesAndWritesTheCorrectedTrajectory) {
  const testing_support::TemporaryFolder folder;
  synth::SynthOptions options = SmallScene();
  options.frames = 80;
  options.rounds = 0.4;
  ASSERT_TRUE(synth::MakeSequence(options, folder / "sequence").ok());
  const testing_support::ProcessResult run =
      MapSequence({folder / "sequence", "--local", "--poses", "none", "--out", folder / "map", "--no-pictures"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, AllOf(HasSubstr("ATE rmse"), HasSubstr("trajectory verdict: ")));
  const nlohmann::json summary = ReadJson(folder / "map/summary.json");
  EXPECT_EQ(summary["poses"], "none");
  const int initializing = summary["tracking"]["initializing"];
  EXPECT_GT(initializing, 0);  // no pose was sent
  EXPECT_LT(initializing, 40);
  EXPECT_EQ(summary["tracking"]["lost"], 0);
  EXPECT_EQ(summary["tracking"]["tracked"], 80 - initializing);
  // The written trajectory is the final trajectory of the map, up to a similarity.
  const auto report = eval::EvaluateTrajectory({.estimated = folder / "map/trajectory.txt",
                                                .ground_truth = folder / "sequence/groundtruth.txt",
                                                .alignment = eval::Alignment::kSim3});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_LT(report->ate_rmse_m, 0.01 * report->path_length_m);
}

TEST(ProgramsTest, LocalMappingNeedsNoServer) {
  const testing_support::TemporaryFolder folder;
  MakeSmallSequence(folder / "sequence");
  const testing_support::ProcessResult run = MapSequence({folder / "sequence", "--local", "--out", folder / "map"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  ExpectMapOfThree(folder / "map");
}

TEST(ProgramsTest, InterruptWritesThePartialMap) {
  const testing_support::TemporaryFolder folder;
  MakeSmallSequence(folder / "sequence");
  // Sending takes two seconds at the recorded rate. The folder is created just before sending starts.
  testing_support::BackgroundProcess run(
      {ROMAP_CLIENT, "run", folder / "sequence", "--local", "--realtime", "--out", folder / "map"});
  ASSERT_TRUE(testing_support::Eventually([&] { return fs::exists(folder / "map/pictures"); }));
  run.Signal(SIGINT);
  const testing_support::ProcessResult result = run.Wait();
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("interrupted"));
  const nlohmann::json summary = ReadJson(folder / "map/summary.json");
  EXPECT_TRUE(summary["interrupted"]);
  EXPECT_LT(summary["frames"]["sent"], 60);
}

TEST(ProgramsTest, DeployedConfigurationEqualsTheDumpedDefaults) {
  std::ifstream file(ROMAP_SOURCE_DIR "/deploy/server.yaml");
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  EXPECT_EQ(testing_support::RunProcess({ROMAP_SERVER, "--dump-config"}).out, text)
      << "update the file with: romap-server --dump-config > deploy/server.yaml";
  EXPECT_EQ(
      testing_support::RunProcess({ROMAP_SERVER, "--config", ROMAP_SOURCE_DIR "/deploy/server.yaml", "--dump-config"})
          .out,
      text);
  const std::regex setting("\n  [a-z]");
  EXPECT_LE(std::distance(std::sregex_iterator(text.begin(), text.end(), setting), std::sregex_iterator()), 24);
}

TEST(ProgramsTest, DumpOfAllSettingsCanBeLoaded) {
  const testing_support::TemporaryFolder folder;
  const testing_support::ProcessResult dump = testing_support::RunProcess(
      {ROMAP_SERVER, "--dump-config", "--expert", "--set", "nerf.preset=paper", "--log-level", "error"});
  EXPECT_THAT(dump.out, AllOf(HasSubstr("\n  levels: 16\n"), HasSubstr("\n  level: \"error\"\n")));
  std::ofstream(folder / "all.yaml") << dump.out;
  EXPECT_EQ(
      testing_support::RunProcess({ROMAP_SERVER, "--dump-config", "--expert", "--config", folder / "all.yaml"}).out,
      dump.out);
}

// ------------------------------------------------------------------------------------------------ invalid input

void ExpectOneLine(const testing_support::ProcessResult& result, int exit_code, const std::string& what) {
  EXPECT_EQ(result.exit_code, exit_code) << result.err;
  EXPECT_THAT(result.err, HasSubstr(what));
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
}

TEST(InvalidInputTest, IncompleteSequenceFolder) {
  const testing_support::TemporaryFolder folder;
  ExpectOneLine(Romap({"run", folder / "nowhere", "--local", "--out", folder / "map"}), 3, "nowhere");
  fs::create_directory(folder / "empty");
  ExpectOneLine(Romap({"run", folder / "empty", "--local", "--out", folder / "map"}), 2,
                "looked for romap sequence (rgb.txt and camera.yaml)");
  std::ofstream(folder / "empty/rgb.txt") << "0.0 rgb/1.png\n";
  ExpectOneLine(Romap({"run", folder / "empty", "--local", "--out", folder / "map"}), 3,
                "1 of 1 listed files are missing");
}

TEST(InvalidInputTest, OutputFolderThatCannotBeCreated) {
  const testing_support::TemporaryFolder folder;
  MakeTinySequence(folder / "sequence");
  std::ofstream(folder / "file") << "not a folder";
  ExpectOneLine(Romap({"run", folder / "sequence", "--local", "--out", folder / "file/map"}), 3, "file/map");
  ExpectOneLine(
      Romap({"run", folder / "sequence", "--local", "--config", folder / "none.yaml", "--out", folder / "map"}), 3,
      "none.yaml: cannot read: No such file or directory");
}

TEST(ProgramsTest, HelpDocumentsTheExitCodes) {
  const testing_support::ProcessResult help = Romap({"--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_THAT(help.out, AllOf(HasSubstr("Exit codes:"), HasSubstr("4    the server cannot be reached")));
}

TEST(ProgramsTest, BothProgramsReportTheSameVersion) {
  const std::string romap = Romap({"--version"}).out;
  const std::string server = testing_support::RunProcess({ROMAP_SERVER, "--version"}).out;
  ASSERT_TRUE(romap.starts_with("romap ")) << romap;
  EXPECT_EQ(server, "romap-server " + romap.substr(std::string("romap ").size()));
}

TEST(InvalidInputTest, OneUnreadableImageIsSkipped) {
  const testing_support::TemporaryFolder folder;
  MakeTinySequence(folder / "sequence");
  for (const auto& entry : fs::directory_iterator(folder / "sequence/rgb")) {
    if (entry.path().filename().string().find("12") != std::string::npos) fs::remove(entry.path());
  }
  const ProcessResult run = Romap({"run", folder / "sequence", "--local", "--out", folder / "map"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, AllOf(HasSubstr("poses: 14 of 14 frames have one"), HasSubstr("1 warning: file_unreadable")));
  EXPECT_THAT(run.err, HasSubstr("1 of 15 images cannot be read"));
  const nlohmann::json summary = ReadJson(folder / "map/summary.json");
  EXPECT_EQ(summary["frames"]["sent"], 14);
  EXPECT_EQ(summary["frames"]["with_pose"], 14);
  EXPECT_EQ(summary["frames"]["skipped"].size(), 1u);
}

TEST(InvalidInputTest, UnreadableImages) {
  const testing_support::TemporaryFolder folder;
  MakeTinySequence(folder / "sequence");
  fs::remove_all(folder / "sequence/rgb");
  ExpectOneLine(Romap({"run", folder / "sequence", "--local", "--out", folder / "map"}), 3,
                "15 of 15 listed files are missing");
}

TEST(InvalidInputTest, UnknownFlagCommandAndConfigKey) {
  const testing_support::TemporaryFolder folder;
  ExpectOneLine(Romap({"run", "x", "--frobnicate"}), 2, "frobnicate");
  ExpectOneLine(Romap({"frobnicate"}), 2, "frobnicate");
  MakeTinySequence(folder / "sequence");
  ExpectOneLine(Romap({"run", folder / "sequence", "--local", "--set", "nerf.rays=1", "--out", folder / "map"}), 2,
                "unknown key 'nerf.rays', did you mean 'nerf.");
  std::ofstream(folder / "bad.yaml") << "mesh:\n  resolutoin: 64\n";
  ExpectOneLine(testing_support::RunProcess({ROMAP_SERVER, "--config", folder / "bad.yaml"}), 2,
                "bad.yaml:2: unknown key 'mesh.resolutoin', did you mean 'mesh.resolution'?");
  ExpectOneLine(testing_support::RunProcess({ROMAP_SERVER, "--frobnicate"}), 2, "frobnicate");
}

TEST(InvalidInputTest, UnreadableConfigurationAndConflictingSettings) {
  const testing_support::TemporaryFolder folder;
  ExpectOneLine(testing_support::RunProcess({ROMAP_SERVER, "--config", folder / "missing.yaml"}), 3,
                "missing.yaml: cannot read: No such file or directory");
  std::ofstream(folder / "conflict.yaml") << "nerf:\n  backend: cuda\n  field: sdf\n";
  ExpectOneLine(testing_support::RunProcess({ROMAP_SERVER, "--config", folder / "conflict.yaml"}), 2,
                "conflict.yaml:2: nerf.backend = cuda does not support nerf.field = sdf");
  MakeTinySequence(folder / "sequence");
  // A local run ignores the sections of the configuration that only romap-server uses.
  const testing_support::ProcessResult run =
      Romap({"run", folder / "sequence", "--local", "--config", ROMAP_SOURCE_DIR "/deploy/server.yaml", "--set",
             "mesh.min_side_nodes=65", "--out", folder / "map"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, MatchesRegex("romap: --set: mesh.min_side_nodes = 65 must not exceed mesh.resolution = 64 "
                                    "\\(.*server.yaml:[0-9]+\\)\n"));
}

TEST(InvalidInputTest, NoServerAndPortInUse) {
  const testing_support::TemporaryFolder folder;
  MakeTinySequence(folder / "sequence");
  testing_support::BackgroundProcess server({ROMAP_SERVER, "--ephemeral", "--listen", "127.0.0.1:0", "--http", ""});
  const std::string address = server.WaitForLine("romap-server listening on ");
  ASSERT_NE(address, "");
  ExpectOneLine(testing_support::RunProcess({ROMAP_SERVER, "--ephemeral", "--listen", address, "--http", ""}), 1,
                "cannot listen on " + address);
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait().exit_code, 0);
  ExpectOneLine(Romap({"run", folder / "sequence", "--server", address, "--out", folder / "map"}), 4,
                "cannot connect to romap-server at " + address);
}

}  // namespace romap::programs_test
