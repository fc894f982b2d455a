#include "client/bench/load_results.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace romap::bench::load_results_test {

using ::testing::HasSubstr;

TEST(LoadResultsTest, PercentilesAreValuesThatOccurred) {
  std::vector<double> values;
  for (int i = 100; i >= 1; --i) values.push_back(i);
  const Percentiles times = PercentilesOf(values);
  EXPECT_EQ(times.count, 100u);
  EXPECT_EQ(times.p50, 50);
  EXPECT_EQ(times.p90, 90);
  EXPECT_EQ(times.p99, 99);
  EXPECT_EQ(times.max, 100);
  EXPECT_EQ(PercentilesOf({7}).p99, 7);
  EXPECT_EQ(PercentilesOf({}).count, 0u);
}

TEST(LoadResultsTest, JainIndexIsOneForEqualAmountsAndOneOverNForOne) {
  EXPECT_DOUBLE_EQ(JainIndex({5, 5, 5}), 1);
  EXPECT_DOUBLE_EQ(JainIndex({9, 0, 0}), 1.0 / 3);
  EXPECT_DOUBLE_EQ(JainIndex({1, 3}), 0.8);
  EXPECT_DOUBLE_EQ(JainIndex({}), 1);
  EXPECT_DOUBLE_EQ(JainIndex({0, 0}), 1);
}

TEST(LoadResultsTest, GrowthIgnoresTheFirstThird) {
  std::vector<MemorySample> samples;
  // 100 MB in the first minute, then 6 MB a minute around 200 MB.
  for (int s = 0; s <= 180; ++s) samples.push_back({1.0 * s, s < 60 ? 1e8 * (1 + s / 60.0) : 1.94e8 + 1e5 * (s - 60)});
  EXPECT_NEAR(GrowthPercentPerMinute(samples), 3, 0.01);
  EXPECT_EQ(GrowthPercentPerMinute({}), 0);
  EXPECT_EQ(GrowthPercentPerMinute({{0, 1}, {1, 2}}), 0);
}

TEST(LoadResultsTest, RefusedClientsAreShownAndDoNotCountForFairness) {
  LoadResults results{.duration_s = 10, .rate_hz = 25, .stalled_viewers = 0};
  results.clients.resize(3);
  results.clients[0].training_steps = results.clients[1].training_steps = 500;
  results.clients[2].refused = "the processor cannot take another live session";
  EXPECT_DOUBLE_EQ(results.TrainingFairness(), 1);
  EXPECT_THAT(ToText(results), HasSubstr("3 refused: the processor cannot take another live session\n"));
  EXPECT_THAT(ToText(results), HasSubstr("3 clients at 25 Hz for 10 s, 1 refused"));
  const auto json = nlohmann::json::parse(ToJson(results));
  EXPECT_EQ(json["clients"][2]["refused"], "the processor cannot take another live session");
  EXPECT_EQ(json["training_fairness"], 1.0);
}

}  // namespace romap::bench::load_results_test
