// Replays a recorded session with the built program.

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "client/synth/synth.h"
#include "tests/integration/quick_run.h"
#include "tests/support/subprocess.h"

namespace romap::replay_test {

using ::testing::HasSubstr;
using testing_support::ProcessResult;
using testing_support::RunProcess;
using testing_support::TemporaryFolder;

namespace fs = std::filesystem;

testing_support::ProcessResult Romap(const std::vector<std::string>& arguments) {
  std::vector<std::string> command(1, ROMAP_CLIENT);
  command.insert(command.end(), arguments.begin(), arguments.end());
  return testing_support::RunProcess(command);
}

std::string Bytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::map<std::string, std::string> AllFiles(const std::string& dir) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(dir)) {
    if (entry.is_regular_file()) files[fs::relative(entry.path(), dir).string()] = Bytes(entry.path());
  }
  return files;
}

class ReplayTest : public ::testing::Test {
 protected:
  // Maps a small sequence with recording enabled. Returns the path of the recording.
  std::string Record(const std::vector<std::string>& more_arguments = {}) const {
    synth::SynthOptions options{.seed = 3, .objects = 2, .frames = 40, .width_px = 240, .height_px = 180};
    EXPECT_TRUE(synth::MakeSequence(options, folder_ / "sequence").ok());
    fs::create_directory(folder_ / "recordings");
    std::vector<std::string> arguments = {
        "run",   folder_ / "sequence", "--local",      "--set", "session.record_dir=" + (folder_ / "recordings"),
        "--out", folder_ / "map",      "--no-pictures"};
    arguments.insert(arguments.end(), more_arguments.begin(), more_arguments.end());
    const testing_support::ProcessResult run = Romap(integration::WithLittleTraining(arguments));
    EXPECT_EQ(run.exit_code, 0) << run.err;
    const auto files = AllFiles(folder_ / "recordings");
    EXPECT_EQ(files.size(), 1U);
    return files.empty() ? "" : (folder_ / "recordings/") + files.begin()->first;
  }

  void ExpectTwoEqualReplays(const std::string& recording) const {
    for (const char* out : {"first", "second"}) {
      const testing_support::ProcessResult replay =
          Romap(integration::WithLittleTraining({"replay", recording, "--out", folder_ / out}));
      ASSERT_EQ(replay.exit_code, 0) << replay.err;
      EXPECT_THAT(replay.out, HasSubstr("40 frames replayed"));
    }
    const auto first = AllFiles(folder_ / "first");
    const auto second = AllFiles(folder_ / "second");
    EXPECT_GE(first.size(), 7U) << "trajectory, cuboids, summary, and a .ply and a .glb of each object";
    ASSERT_EQ(first.size(), second.size());
    for (const auto& [name, bytes] : first) EXPECT_TRUE(second.at(name) == bytes) << name << " differs";
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(ReplayTest, TwoReplaysWriteTheSameBytes) { ExpectTwoEqualReplays(Record()); }

TEST_F(ReplayTest, TwoReplaysWithLateMasksWriteTheSameBytes) {
  const std::string recording = Record({"--mask-rate", "12.5", "--mask-delay", "0.2"});
  const nlohmann::json run = nlohmann::json::parse(std::ifstream(folder_ / "map/summary.json"));
  EXPECT_EQ(run["masks"]["sent_with_frames"], 0);
  EXPECT_EQ(run["masks"]["sent_late"], 20) << "25 frames/s, masks of every second one of 40 frames";
  EXPECT_EQ(run["masks"]["late_rejected"], 0);
  ExpectTwoEqualReplays(recording);
  const nlohmann::json replay = nlohmann::json::parse(std::ifstream(folder_ / "first/summary.json"));
  EXPECT_EQ(replay["late_masks"], 20);
}

TEST_F(ReplayTest, ReplaysATruncatedRecordingUpToItsEnd) {
  const std::string recording = Record();
  fs::resize_file(recording, fs::file_size(recording) - 1000);
  const testing_support::ProcessResult replay =
      Romap(integration::WithLittleTraining({"replay", recording, "--threads", "--out", folder_ / "out"}));
  ASSERT_EQ(replay.exit_code, 0) << replay.err;
  EXPECT_THAT(replay.err, HasSubstr("the last record is truncated"));
  EXPECT_THAT(replay.out, HasSubstr("39 frames replayed"));
}

TEST_F(ReplayTest, RejectsInvalidRecordingsWithAOneLineMessage) {
  const std::string text = folder_ / "notes.txt";
  std::ofstream(text) << "not a recording at all";
  std::ofstream(folder_ / "old.romaprec") << "ROMAPREC" << std::string("\x9\0\0\0", 4);
  for (const auto& [file, fault, exit_code] : {std::tuple{text, "must start with ROMAPREC", 2},
                                               std::tuple{folder_ / "old.romaprec", "version must be 1 to 2, is 9", 2},
                                               std::tuple{folder_ / "missing.romaprec", "missing.romaprec", 3}}) {
    const testing_support::ProcessResult replay = Romap({"replay", file, "--out", folder_ / "out"});
    EXPECT_EQ(replay.exit_code, exit_code);
    EXPECT_THAT(replay.err, HasSubstr(fault));
    EXPECT_EQ(std::count(replay.err.begin(), replay.err.end(), '\n'), 1) << replay.err;
  }
}

TEST_F(ReplayTest, ReportsAMissingRecordingFolderBeforeSendingFrames) {
  synth::SynthOptions options{.seed = 3, .objects = 1, .frames = 2, .width_px = 64, .height_px = 48};
  ASSERT_TRUE(synth::MakeSequence(options, folder_ / "sequence").ok());
  const testing_support::ProcessResult run =
      Romap({"run", folder_ / "sequence", "--local", "--set", "session.record_dir=" + (folder_ / "nowhere"), "--out",
             folder_ / "map"});
  EXPECT_EQ(run.exit_code, 3);
  EXPECT_THAT(run.err, HasSubstr("nowhere"));
}

}  // namespace romap::replay_test
