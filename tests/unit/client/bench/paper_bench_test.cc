#include "client/bench/paper_bench.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "client/files/text_file.h"
#include "tests/unit/client/bench/tiny_sequence.h"

namespace romap::bench::paper_bench_test {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

PaperBenchOptions TinyBench(const testing_support::TinySequence& data) {
  PaperBenchOptions options;
  options.sequence_dir = data.dir();
  options.out_dir = data / "out";
  options.seeds = 1;
  options.subsets = 1;
  options.threads = 1;
  options.tables = {"1"};
  options.methods = {"fast", "hull"};
  options.settings = {"nerf.levels=4",
                      "nerf.log2_table_entries=10",
                      "nerf.rays_per_step=256",
                      "nerf.full_budget_steps=40",
                      "nerf.first_budget_steps=7",
                      "nerf.max_extra_steps=0",
                      "mesh.resolution=24",
                      "mesh.min_side_nodes=24"};
  return options;
}

absl::StatusOr<PaperResults> RunBench(const PaperBenchOptions& options) {
  return RunPaperBench(
      options, [](double, const std::string&) {}, [] { return false; });
}

nlohmann::json ReadJson(const std::string& path) { return nlohmann::json::parse(std::ifstream(path)); }

TEST(PaperBenchTest, WritesReportPlotAndMeshes) {
  const testing_support::TinySequence data;
  const PaperBenchOptions options = TinyBench(data);
  const absl::StatusOr<PaperResults> results = RunBench(options);
  ASSERT_TRUE(results.ok()) << Message(results.status());
  EXPECT_EQ(results->runs_done, 1);
  for (const char* method : {"fast", "hull"}) {
    const auto mean = MeanOf(*results, method, kToTheEnd_s);
    ASSERT_TRUE(mean.has_value()) << method;
    EXPECT_EQ(mean->found_share, 1) << method;
    EXPECT_GT(mean->quality.accuracy_cm, 0) << method;
    EXPECT_LT(mean->quality.accuracy_cm, 3) << method;
    EXPECT_EQ(mean->steps, method == std::string("fast") ? 40 : 0);
    size_t meshes = 0;
    for (const auto& entry : fs::directory_iterator(options.out_dir + "/meshes/" + method + "/objects")) {
      meshes += entry.path().extension() == ".ply";
    }
    EXPECT_EQ(meshes, 2u) << method;
  }
  EXPECT_THAT(*files::ReadFile(options.out_dir + "/paper.md"), HasSubstr("| ours, fast | "));
  EXPECT_EQ(ReadJson(options.out_dir + "/paper.json")["runs"]["done"], 1);
  EXPECT_GT(fs::file_size(options.out_dir + "/convergence.png"), 1000u);
  EXPECT_FALSE(fs::exists(options.out_dir + "/scratch"));
  // A curve ends with the training of its method.
  ASSERT_FALSE(results->curves.empty());
  EXPECT_EQ(results->curves.back().accuracy_cm, MeanOf(*results, "fast", kToTheEnd_s)->quality.accuracy_cm);
}

TEST(PaperBenchTest, RunsAllSeedsOnAllSubsets) {
  const testing_support::TinySequence data;
  PaperBenchOptions options = TinyBench(data);
  options.seeds = 2;
  options.subsets = 2;
  options.every = 6;
  options.times_s = {100};  // beyond the cap, so only the end is measured
  const absl::StatusOr<PaperResults> results = RunBench(options);
  ASSERT_TRUE(results.ok()) << Message(results.status());
  EXPECT_EQ(results->frames_per_subset, 4);
  std::set<std::pair<int, int>> runs;
  std::set<double> accuracies;
  for (const Evaluation& e : results->evaluations) {
    EXPECT_EQ(e.limit_s, kToTheEnd_s);
    if (e.method != "fast") continue;
    runs.insert({e.seed, e.subset});
    accuracies.insert(e.quality->accuracy_cm);
  }
  EXPECT_EQ(runs.size(), 4u);
  EXPECT_EQ(accuracies.size(), 4u) << "seeds and subsets differ";
  EXPECT_EQ(MeanOf(*results, "hull", kToTheEnd_s)->evaluations, 2) << "the hull does not depend on the seed";
}

TEST(PaperBenchTest, MethodsWithEqualSettingsRunOnce) {
  const testing_support::TinySequence data;
  PaperBenchOptions options = TinyBench(data);
  options.tables = {"1", "ablation"};
  options.methods = {"fast", "all-parts", "no-density"};
  std::vector<std::string> trained;
  const auto results = RunPaperBench(
      options, [&](double, const std::string& text) { trained.push_back(text); }, [] { return false; });
  ASSERT_TRUE(results.ok()) << Message(results.status());
  EXPECT_EQ(std::ranges::count_if(trained, [](const std::string& t) { return t.find("all-parts") != t.npos; }), 0);
  EXPECT_EQ(MeanOf(*results, "all-parts", kToTheEnd_s)->quality.accuracy_cm,
            MeanOf(*results, "fast", kToTheEnd_s)->quality.accuracy_cm);
  EXPECT_NE(MeanOf(*results, "no-density", kToTheEnd_s)->quality.accuracy_cm,
            MeanOf(*results, "fast", kToTheEnd_s)->quality.accuracy_cm);
}

TEST(PaperBenchTest, InterruptKeepsPartialResults) {
  const testing_support::TinySequence data;
  PaperBenchOptions options = TinyBench(data);
  options.seeds = 3;
  std::string last;
  const auto results = RunPaperBench(
      options, [&](double, const std::string& text) { last = text; },
      [&] { return last.find("seed 2") != std::string::npos; });
  ASSERT_TRUE(results.ok()) << Message(results.status());
  EXPECT_EQ(results->runs_done, 1);
  const nlohmann::json json = ReadJson(options.out_dir + "/paper.json");
  EXPECT_EQ(json["runs"]["done"], 1);
  EXPECT_EQ(json["runs"]["planned"], 3);
  EXPECT_THAT(*files::ReadFile(options.out_dir + "/paper.md"), HasSubstr("Interrupted: some rows are incomplete"));
  EXPECT_FALSE(fs::exists(options.out_dir + "/scratch"));
}

TEST(PaperBenchTest, RunsSignedDistanceFields) {
  const testing_support::TinySequence data;
  PaperBenchOptions options = TinyBench(data);
  options.methods = {"fast", "sdf"};
  const absl::StatusOr<PaperResults> results = RunBench(options);
  ASSERT_TRUE(results.ok()) << Message(results.status());
  const auto fast = MeanOf(*results, "fast", kToTheEnd_s), sdf = MeanOf(*results, "sdf", kToTheEnd_s);
  ASSERT_TRUE(fast.has_value() && sdf.has_value());
  EXPECT_NE(fast->quality.accuracy_cm, sdf->quality.accuracy_cm);
}

TEST(PaperBenchTest, RunsAdditionalRowsAndRejectsInvalidOnes) {
  const testing_support::TinySequence data;
  PaperBenchOptions options = TinyBench(data);
  options.more_methods = {{.id = "mine", .title = "mine", .settings = {"nerf.full_budget_steps=7"}}};
  options.methods = {"mine"};
  const absl::StatusOr<PaperResults> results = RunBench(options);
  ASSERT_TRUE(results.ok()) << Message(results.status());
  EXPECT_EQ(MeanOf(*results, "mine", kToTheEnd_s)->steps, 7);
  options.more_methods[0].settings = {"nerf.no_such_field=1"};
  EXPECT_THAT(Message(RunBench(options).status()), HasSubstr("nerf.no_such_field"));
  options.more_methods[0] = {.id = "fast", .title = "mine"};
  EXPECT_THAT(Message(RunBench(options).status()), HasSubstr("'fast' already exists"));
}

TEST(PaperBenchTest, NamesInvalidInput) {
  const testing_support::TinySequence data;
  const auto error_of = [&](const std::function<void(PaperBenchOptions&)>& change) {
    PaperBenchOptions options = TinyBench(data);
    change(options);
    return Message(RunBench(options).status());
  };
  EXPECT_THAT(error_of([](auto& o) { o.methods = {"fats"}; }),
              HasSubstr("unknown method 'fats'; expected one of all-parts, "));
  EXPECT_THAT(error_of([](auto& o) { o.subsets = 5; }), HasSubstr("subsets is 5; expected 1 to 4"));
  EXPECT_THAT(error_of([](auto& o) { o.seeds = 0; }), HasSubstr("seeds is 0"));
  EXPECT_THAT(error_of([](auto& o) { o.times_s = {5, 1}; }), HasSubstr("times contain 1 s"));
  EXPECT_THAT(error_of([](auto& o) { o.cap_s = 0; }), HasSubstr("cap is 0 s"));
  EXPECT_THAT(error_of([](auto& o) { o.settings = {"nerf.levles=3"}; }), HasSubstr("nerf.levels"));
  EXPECT_THAT(error_of([](auto& o) { o.methods = {"size-14-1"}; }), HasSubstr("no method selected")) << "of Table 1";
  EXPECT_THAT(error_of([](auto& o) { o.sequence_dir += "/nowhere"; }), HasSubstr("nowhere"));
  fs::remove_all(data.dir() + "/gt");
  EXPECT_THAT(error_of([](auto&) {}), HasSubstr("gt"));
}

TEST(PaperBenchTest, QuickReducesTheRun) {
  PaperBenchOptions options;
  options.more_methods = {{.id = "mine", .title = "mine"}};
  const PaperBenchOptions quick = Quick(options);
  EXPECT_EQ(quick.seeds * quick.subsets, 1);
  EXPECT_THAT(quick.tables, ::testing::ElementsAre("1"));
  EXPECT_THAT(quick.methods, ::testing::ElementsAre("fast", "hull", "mine"));
}

}  // namespace romap::bench::paper_bench_test
