#include "client/bench/paper_results.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace romap::bench::paper_results_test {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

ObjectTraining Training(const std::string& object, int steps, double train_s) {
  ObjectTraining o;
  o.object = object;
  o.steps = steps;
  o.train_s = train_s;
  o.wall_s = 2 * train_s;
  o.setup_s = 0.5;
  o.mesh_s = 0.02;
  o.sampling_s = 0.2 * train_s;
  o.forward_s = 0.6 * train_s;
  o.backward_s = 1.2 * train_s;
  o.samples = static_cast<uint64_t>(1000 * steps);
  return o;
}

Evaluation Row(const std::string& method, double limit_s, int seed, const PublishedQuality& quality) {
  Evaluation e{.method = method, .limit_s = limit_s, .seed = seed};
  e.objects = {Training("cup", 100, 0.1), Training("book", 300, 0.3)};
  e.quality = quality;
  e.matched = 2;
  return e;
}

PaperResults TwoSeeds() {
  PaperResults r;
  r.sequence = "desk";
  r.objects = 2;
  r.threads = 2;
  r.cap_s = 20;
  r.times_s = {1};
  r.runs_planned = 4;
  r.runs_done = 2;
  r.fma_peak_gflops = {100, 300, 200};
  r.tables = {{"1", {{.id = "fast", .title = "ours, fast"}, {.id = "paper", .title = "as in the paper"}}},
              {"4", {{.id = "size-16-2", .title = "2^16 entries, 2 hidden layers"}}}};
  r.evaluations = {Row("fast", 1, 1, {0.4, 0.2, 80, 98}),
                   Row("fast", kToTheEnd_s, 1, {0.3, 0.2, 90, 99}),
                   Row("fast", 1, 2, {0.6, 0.4, 70, 90}),
                   Row("fast", kToTheEnd_s, 2, {0.3, 0.1, 92, 100}),
                   Row("paper", kToTheEnd_s, 1, {0.5, 0.3, 75, 97}),
                   Row("size-16-2", kToTheEnd_s, 1, {0.7, 0.5, 60, 80})};
  r.curves = {{"fast", 0.1, 0.5, 0.3}, {"fast", 0.2, 0.4, 0.25}};
  return r;
}

TEST(PaperResultsTest, MeansAreOverOneMethodAndLimit) {
  const auto mean = MeanOf(TwoSeeds(), "fast", 1);
  ASSERT_TRUE(mean.has_value());
  EXPECT_EQ(mean->evaluations, 2);
  EXPECT_DOUBLE_EQ(mean->quality.accuracy_cm, 0.5);
  EXPECT_DOUBLE_EQ(mean->quality.completion_cm, 0.3);
  EXPECT_DOUBLE_EQ(mean->quality.below_04_percent, 75);
  EXPECT_DOUBLE_EQ(mean->quality.below_1_percent, 94);
  EXPECT_NEAR(mean->spread.accuracy_cm, 0.2 / std::sqrt(2.0), 1e-12);
  EXPECT_NEAR(MeanOf(TwoSeeds(), "fast", kToTheEnd_s)->spread.accuracy_cm, 0, 1e-12);
  EXPECT_FALSE(MeanOf(TwoSeeds(), "fast", 5).has_value());
  EXPECT_FALSE(MeanOf(TwoSeeds(), "paper", 1).has_value());
}

TEST(PaperResultsTest, CostsArePerObjectAndPerStep) {
  const MethodMean mean = *MeanOf(TwoSeeds(), "fast", 1);
  EXPECT_DOUBLE_EQ(mean.steps, 200);
  EXPECT_DOUBLE_EQ(mean.train_s, 0.2);
  EXPECT_DOUBLE_EQ(mean.wall_s, 0.4);
  EXPECT_DOUBLE_EQ(mean.setup_s, 0.5);
  EXPECT_DOUBLE_EQ(mean.mesh_ms, 20);
  EXPECT_DOUBLE_EQ(mean.iteration_ms, 1);
  EXPECT_DOUBLE_EQ(mean.sampling_ms, 0.1);  // CPU time of two threads / 2
  EXPECT_DOUBLE_EQ(mean.forward_ms, 0.3);
  EXPECT_DOUBLE_EQ(mean.backward_ms, 0.6);
  EXPECT_NEAR(mean.samples_per_s, 1e6, 1e-3);
  EXPECT_FALSE(mean.limited);
}

TEST(PaperResultsTest, ShowsMissingObjectsAndShortenedPlans) {
  PaperResults r = TwoSeeds();
  r.evaluations[0].matched = 1;
  r.evaluations[2].objects[1].limited = true;
  EXPECT_DOUBLE_EQ(MeanOf(r, "fast", 1)->found_share, 0.75);
  EXPECT_TRUE(MeanOf(r, "fast", 1)->limited);
  r.evaluations[0].quality.reset();  // no figures: all objects are missing
  r.evaluations[0].matched = 0;
  EXPECT_DOUBLE_EQ(MeanOf(r, "fast", 1)->quality.accuracy_cm, 0.6);
  EXPECT_DOUBLE_EQ(MeanOf(r, "fast", 1)->found_share, 0.5);
  EXPECT_THAT(ToMarkdown(r), AllOf(HasSubstr("| 50 % |"), HasSubstr("200 (shortened)")));
}

TEST(PaperResultsTest, FmaPeakIsTheMedian) {
  EXPECT_EQ(FmaPeak(TwoSeeds()), 200);
  EXPECT_EQ(FmaPeak(PaperResults()), 0);
}

TEST(PaperResultsTest, MarkdownComparesWithThePaper) {
  const std::string text = ToMarkdown(TwoSeeds());
  EXPECT_THAT(text, HasSubstr("means over 2 of 4 runs"));
  EXPECT_THAT(text, HasSubstr("### After at most 1 s of training per object"));
  // 0.2 s at 200 GFLOP/s are 0.04 TFLOP.
  EXPECT_THAT(text,
              HasSubstr("| ours, fast | 0.500 ± 0.141 | 0.300 ± 0.141 | 75.00 | 94.00 | 100 % | 200 | 0.20 | 0.40 "
                        "| 0.040 | 0.431 / 0.248 / 80.85 / 98.93 |"));
  EXPECT_THAT(text, HasSubstr("| ours, fast | 0.300 ± 0.000 | 0.150 ± 0.071 | 91.00 | 99.50 |"));
  EXPECT_THAT(text, HasSubstr("| COLMAP | - |"));
  EXPECT_THAT(text, HasSubstr("0.612 / 0.656 / 57.72 / 81.17"));
  EXPECT_THAT(text, HasSubstr("| backward and optimization | 0.600 | 0.600 | 0.455 |"));
  EXPECT_THAT(text, HasSubstr("| surface (in the paper 64^3 nodes) | 20.000 | 20.000 | 2.84 |"));
  EXPECT_THAT(text, HasSubstr("| 2^16 entries, 2 hidden layers | 0.700 ± 0.000 | 0.500 ± 0.000 | 1.000 | 200 | 0.409 / "
                              "0.241 / 0.862 |"));
  EXPECT_THAT(text, HasSubstr("| fast | 0.2 | 0.400 | 0.250 |"));
  EXPECT_THAT(text, Not(HasSubstr("## Ablation")));
}

TEST(PaperResultsTest, JsonHasTheSameFigures) {
  const nlohmann::json json = nlohmann::json::parse(ToJsonText(TwoSeeds()));
  EXPECT_EQ(json["runs"]["done"], 2);
  const nlohmann::json& fast = json["tables"][0]["rows"][0];
  EXPECT_EQ(fast["id"], "fast");
  EXPECT_EQ(fast["paper_rtx4090"]["accuracy_cm"], 0.431);
  ASSERT_EQ(fast["results"].size(), 2u);
  EXPECT_EQ(fast["results"][0]["limit_s"], 1);
  EXPECT_EQ(fast["results"][0]["mean"]["accuracy_cm"], 0.5);
  EXPECT_TRUE(fast["results"][1]["limit_s"].is_null());
  EXPECT_EQ(fast["results"][1]["mean"]["below_1_percent"], 99.5);
  EXPECT_EQ(json["evaluations"].size(), 6u);
  EXPECT_EQ(json["evaluations"][2]["seed"], 2);
  EXPECT_EQ(json["evaluations"][2]["objects"][1]["object"], "book");
  EXPECT_EQ(json["curves"][1]["completion_cm"], 0.25);
}

}  // namespace romap::bench::paper_results_test
