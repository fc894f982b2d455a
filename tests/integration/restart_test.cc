// A server that is killed while a client maps, and a session that is continued on another day.

#include <gmock/gmock.h>
#include <signal.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "client/synth/synth.h"
#include "tests/integration/quick_run.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::restart_test {

using ::testing::HasSubstr;
using testing_support::BackgroundProcess;
using testing_support::ProcessResult;
using testing_support::RunProcess;

nlohmann::json ReadJson(const std::string& path) { return nlohmann::json::parse(std::ifstream(path)); }

class RestartTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const synth::SynthOptions options{.seed = 3, .objects = 3, .frames = 60, .width_px = 320, .height_px = 240};
    ASSERT_TRUE(synth::MakeSequence(options, folder_ / "sequence").ok());
    Start("127.0.0.1:0");
  }
  // The port of the first start is used again, because clients come back to it. The queue holds the whole sequence, so
  // that a slow machine drops no live frame.
  void Start(const std::string& address, bool little_training = false) {
    const std::vector<std::string> command{ROMAP_SERVER,
                                           "--listen",
                                           address,
                                           "--http",
                                           "",
                                           "--data-dir",
                                           folder_ / "data",
                                           "--set",
                                           "session.frame_queue=64",
                                           "--set",
                                           "mesh.texture=false"};
    server_ = std::make_unique<BackgroundProcess>(little_training ? integration::WithLittleTraining(command)
                                                                  : integration::Quick(command));
    address_ = server_->WaitForLine("romap-server listening on ");
    ASSERT_NE(address_, "");
  }
  void KillAndStart() {
    server_->Signal(SIGKILL);
    server_->Wait();
    Start(address_);
  }
  std::vector<std::string> RunCommand(std::vector<std::string> arguments) {
    std::vector<std::string> command{ROMAP_CLIENT, "run",   folder_ / "sequence", "--server",
                                     address_,     "--out", folder_ / "map",      "--no-pictures"};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return command;
  }
  ProcessResult Sessions(std::vector<std::string> arguments = {}) {
    std::vector<std::string> command{ROMAP_CLIENT, "sessions", "--server", address_};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return RunProcess(command);
  }
  void ExpectWholeMap() {
    const nlohmann::json summary = ReadJson(folder_ / "map/summary.json");
    EXPECT_EQ(summary["objects"].size(), 3u) << summary.dump(1);
    EXPECT_THAT(summary["faults"], ::testing::IsEmpty()) << summary["faults"].dump(1);
    if (integration::kShapesAreGood) {
      EXPECT_LT(summary["evaluation"]["objects"]["mean"]["comp_seen_cm"].get<double>(), 0.8) << summary.dump(1);
    }
  }

  testing_support::TemporaryFolder folder_;
  std::unique_ptr<BackgroundProcess> server_;
  std::string address_;
};

// ROMAP_TEST_KILLS: their number, for longer runs.
TEST_F(RestartTest, KillsOfTheServerLoseNothing) {
  const char* text = std::getenv("ROMAP_TEST_KILLS");
  const int kills = text != nullptr ? std::atoi(text) : 10;
  std::mt19937 random(std::random_device{}());
  int done = 0;
  for (int run = 0; done < kills; ++run) {
    BackgroundProcess client(RunCommand({"--realtime"}));
    for (int i = 0; i < 3 && done < kills; ++i, ++done) {
      std::this_thread::sleep_for(std::chrono::milliseconds(300 + random() % 900));
      KillAndStart();
    }
    const ProcessResult end = client.Wait();
    ASSERT_EQ(end.exit_code, 0) << "after " << done << " kills: " << end.err;
    EXPECT_THAT(end.err, HasSubstr("link lost, retrying"));
    const nlohmann::json summary = ReadJson(folder_ / "map/summary.json");
    EXPECT_EQ(summary["frames"]["sent"], 60);
    EXPECT_EQ(summary["frames"]["rejected"], 0);
    ExpectWholeMap();
  }
  EXPECT_THAT(Sessions().out, HasSubstr("(no sessions)")) << "each run deletes its session when its map is saved";
}

TEST_F(RestartTest, ASessionIsContinuedAfterARestartAndCarriedToAnotherServer) {
  const ProcessResult first = RunProcess(RunCommand({"--frames", "40", "--leave-open"}));
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const std::string id = ReadJson(folder_ / "map/summary.json")["session"];
  EXPECT_THAT(Sessions({"--save", id, "--file", folder_ / "table.romap"}).out, HasSubstr("saved to"));
  KillAndStart();
  const ProcessResult second = RunProcess(RunCommand({"--session", id}));
  ASSERT_EQ(second.exit_code, 0) << second.err;
  EXPECT_EQ(ReadJson(folder_ / "map/summary.json")["frames"]["sent"], 20);
  ExpectWholeMap();
  EXPECT_THAT(Sessions().out, HasSubstr("finished"));

  EXPECT_THAT(Sessions({"--delete", id}).out, HasSubstr("(no sessions)"));
  const std::string loaded = Sessions({"--load", folder_ / "table.romap"}).out;
  const std::string copy = loaded.substr(loaded.find("is session ") + 11, 32);
  const ProcessResult continued = RunProcess(RunCommand({"--session", copy}));
  ASSERT_EQ(continued.exit_code, 0) << continued.err;
  ExpectWholeMap();
}

TEST_F(RestartTest, ASecondServerOnTheDataFolderIsRefused) {
  const ProcessResult second =
      RunProcess({ROMAP_SERVER, "--listen", "127.0.0.1:0", "--http", "", "--data-dir", folder_ / "data"});
  EXPECT_EQ(second.exit_code, 1);
  EXPECT_THAT(second.err, HasSubstr("the data folder is used by process "));
}

TEST_F(RestartTest, AMapThatCannotBeSavedStaysOnTheServer) {
  server_.reset();
  Start("127.0.0.1:0", /*little_training=*/true);
  std::filesystem::create_directories(folder_ / "map/trajectory.txt");  // a folder in the place of a file
  const ProcessResult run = RunProcess(RunCommand({"--frames", "20"}));
  EXPECT_NE(run.exit_code, 0);
  EXPECT_THAT(run.err, HasSubstr("is stored on the server; get its map with: romap export"));
  EXPECT_THAT(Sessions().out, HasSubstr("finished"));
}

}  // namespace romap::restart_test
