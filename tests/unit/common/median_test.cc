#include "common/median.h"

#include <gtest/gtest.h>

namespace romap {
namespace {

TEST(Median, IsTheMiddleOrTheLargerOfTheMiddleTwo) {
  EXPECT_EQ(Median(std::vector<int>{4}), 4);
  EXPECT_EQ(Median(std::vector<int>{9, 1, 5}), 5);
  EXPECT_EQ(Median(std::vector<double>{8, 2, 6, 4}), 6);
}

}  // namespace
}  // namespace romap
