// Runs `romap bench paper` like a user on a small synthetic sequence, to completion and interrupted.

#include <gmock/gmock.h>
#include <signal.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "client/synth/synth.h"
#include "tests/integration/quick_run.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::bench_command_test {

using ::testing::HasSubstr;
using testing_support::BackgroundProcess;
using testing_support::ProcessResult;
using testing_support::RunProcess;
using testing_support::TemporaryFolder;

namespace fs = std::filesystem;

void MakeSmallSequence(const std::string& dir) {
  synth::SynthOptions options;
  options.seed = 3;
  options.objects = 2;
  options.frames = integration::kShapesAreGood ? 24 : 12;
  options.width_px = integration::kShapesAreGood ? 200 : 80;
  options.height_px = integration::kShapesAreGood ? 150 : 60;
  ASSERT_TRUE(synth::MakeSequence(options, dir).ok());
}

std::vector<std::string> BenchPaper(const testing_support::TemporaryFolder& folder,
                                    const std::vector<std::string>& more) {
  const std::string steps = integration::kShapesAreGood ? "60" : "10",
                    nodes = integration::kShapesAreGood ? "32" : "16";
  std::vector<std::string> command = {ROMAP_CLIENT, "bench",
                                      "paper",      folder / "sequence",
                                      "--out",      folder / "out",
                                      "--threads",  "1",
                                      "--set",      "nerf.full_budget_steps=" + steps,
                                      "--set",      "nerf.first_budget_steps=" + steps,
                                      "--set",      "mesh.resolution=" + nodes,
                                      "--set",      "mesh.min_side_nodes=" + nodes};
  command.insert(command.end(), more.begin(), more.end());
  return command;
}

nlohmann::json ReadJson(const std::string& path) { return nlohmann::json::parse(std::ifstream(path)); }

TEST(BenchCommandTest, QuickBenchWritesTablesAndPlot) {
  const testing_support::TemporaryFolder folder;
  MakeSmallSequence(folder / "sequence");
  const testing_support::ProcessResult run =
      testing_support::RunProcess(BenchPaper(folder, {"--quick", "--row", "narrow: nerf.hidden_width=16"}));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.out, HasSubstr("## Table 1"));
  EXPECT_THAT(run.out, HasSubstr("## Table 3"));
  EXPECT_THAT(run.out, HasSubstr("report: " + folder.path() + "/out/paper.md"));
  const nlohmann::json json = ReadJson(folder / "out/paper.json");
  std::vector<std::string> rows;
  for (const nlohmann::json& row : json["tables"][0]["rows"]) {
    rows.push_back(row["id"]);
    if (!integration::kShapesAreGood) continue;
    EXPECT_EQ(row["results"].back()["found_share"], 1) << row.dump(1);
    EXPECT_LT(row["results"].back()["mean"]["completion_cm"], 1.5) << row.dump(1);
  }
  EXPECT_THAT(rows, ::testing::ElementsAre("fast", "hull", "narrow"));
  EXPECT_GT(fs::file_size(folder / "out/convergence.png"), 1000u);
  EXPECT_TRUE(fs::exists(folder / "out/meshes/fast/objects"));

  const testing_support::ProcessResult wrong = testing_support::RunProcess(BenchPaper(folder, {"--methods", "fats"}));
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("unknown method 'fats'"));
}

TEST(BenchCommandTest, InterruptWritesAPartialReport) {
  const testing_support::TemporaryFolder folder;
  MakeSmallSequence(folder / "sequence");
  testing_support::BackgroundProcess bench(
      BenchPaper(folder, {"--methods", "fast", "--tables", "1", "--seeds", "500"}));
  ASSERT_TRUE(testing_support::Eventually([&] { return fs::exists(folder / "out/paper.json"); }));
  bench.Signal(SIGINT);
  const testing_support::ProcessResult end = bench.Wait();
  EXPECT_EQ(end.exit_code, 130) << end.err;
  EXPECT_THAT(end.err, HasSubstr("of 1500 runs"));
  EXPECT_THAT(end.out, HasSubstr("Interrupted: some rows are incomplete"));
  const nlohmann::json runs = ReadJson(folder / "out/paper.json")["runs"];
  EXPECT_GE(runs["done"], 1);
  EXPECT_LT(runs["done"], 1500);
}

}  // namespace romap::bench_command_test
