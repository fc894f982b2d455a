#include "common/disjoint_sets.h"

#include <gtest/gtest.h>

namespace romap::disjoint_sets_test {

TEST(DisjointSetsTest, JoinedNumbersHaveTheSameRoot) {
  DisjointSets sets(5);
  EXPECT_NE(sets.Root(0), sets.Root(1));
  sets.Join(0, 1);
  sets.Join(3, 4);
  sets.Join(1, 4);
  EXPECT_EQ(sets.Root(0), sets.Root(3));
  EXPECT_NE(sets.Root(0), sets.Root(2));
}

}  // namespace romap::disjoint_sets_test
