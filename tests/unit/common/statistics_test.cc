#include "common/statistics.h"

#include <gtest/gtest.h>

namespace romap::statistics_test {

TEST(Statistics, OrderStatisticCountsFromTheSmallest) {
  EXPECT_EQ(OrderStatistic(std::vector<int>{7, 3, 9}, 0), 3);
  EXPECT_EQ(OrderStatistic(std::vector<int>{7, 3, 9}, 1), 7);
  EXPECT_EQ(OrderStatistic(std::vector<int>{7, 3, 9}, 2), 9);
}

TEST(Statistics, MedianOfAnEvenCountIsTheLargerOfTheMiddleTwo) {
  EXPECT_EQ(Median(std::vector<int>{4}), 4);
  EXPECT_EQ(Median(std::vector<int>{9, 1, 5}), 5);
  EXPECT_EQ(Median(std::vector<double>{8, 2, 6, 4}), 6);
}

TEST(Statistics, LowerQuantileRoundsTheRankDown) {
  const std::vector<double> values = {40, 10, 30, 20};
  EXPECT_EQ(LowerQuantile(values, 0), 10);
  EXPECT_EQ(LowerQuantile(values, 0.5), 20);
  EXPECT_EQ(LowerQuantile(values, 0.99), 30);
  EXPECT_EQ(LowerQuantile(values, 1), 40);
}

TEST(Statistics, NearestQuantileRoundsTheRankToTheNearest) {
  const std::vector<double> values = {40, 10, 30, 20};
  EXPECT_EQ(NearestQuantile(values, 0.1), 10);
  EXPECT_EQ(NearestQuantile(values, 0.5), 30);
  EXPECT_EQ(NearestQuantile(values, 0.99), 40);
}

TEST(Statistics, QuantileInterpolatesLinearly) {
  EXPECT_DOUBLE_EQ(Quantile({4, 1, 3, 2}, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(Quantile({4, 1, 3, 2}, 0), 1);
  EXPECT_DOUBLE_EQ(Quantile({4, 1, 3, 2}, 1), 4);
  EXPECT_DOUBLE_EQ(Quantile({10, 20}, 0.01), 10.1);
  EXPECT_DOUBLE_EQ(Quantile({7}, 0.3), 7);
}

}  // namespace romap::statistics_test
