#include "client/files/associate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace romap::files::associate_test {

using ::testing::ElementsAre;
using ::testing::Pair;

TEST(AssociateTimestampsTest, PairsOneToOneAndClosestFirst) {
  const std::vector<int64_t> a{0, 100, 200, 300};
  const std::vector<int64_t> b{95, 104, 190, 1000};
  EXPECT_THAT(AssociateTimestamps(a, b, 10), ElementsAre(Pair(1, 1), Pair(2, 2)));
  EXPECT_THAT(AssociateTimestamps(a, b, 9), ElementsAre(Pair(1, 1)));
  EXPECT_THAT(AssociateTimestamps(a, b, 100), ElementsAre(Pair(0, 0), Pair(1, 1), Pair(2, 2)));
  EXPECT_TRUE(AssociateTimestamps(a, {}, 10).empty());
}

TEST(MedianStepTest, IgnoresGaps) {
  const std::vector<int64_t> times{0, 10, 20, 1000, 1010, 1021};
  EXPECT_EQ(MedianStep_ns(times), 10);
  EXPECT_EQ(MedianStep_ns({}), 0);
}

}  // namespace romap::files::associate_test
