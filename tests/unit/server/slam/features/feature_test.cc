#include "server/slam/features/feature.h"

#include <gtest/gtest.h>

#include <bitset>
#include <random>

namespace romap::slam::feature_test {

TEST(HammingDistance, CountsDifferingBits) {
  std::mt19937_64 random(1);
  for (int round = 0; round < 200; ++round) {
    Descriptor a;
    Descriptor b;
    size_t expected = 0;
    for (size_t i = 0; i < a.size(); ++i) {
      a[i] = random();
      b[i] = round % 2 == 0 ? random() : a[i] ^ (uint64_t{1} << (random() % 64));
      expected += std::bitset<64>(a[i] ^ b[i]).count();
    }
    EXPECT_EQ(static_cast<size_t>(HammingDistance(a, b)), expected);
  }
}

TEST(HammingDistance, IsZeroForEqualAnd256ForInvertedDescriptors) {
  const Descriptor zeros{};
  const Descriptor ones{~uint64_t{0}, ~uint64_t{0}, ~uint64_t{0}, ~uint64_t{0}};
  EXPECT_EQ(HammingDistance(zeros, zeros), 0);
  EXPECT_EQ(HammingDistance(zeros, ones), 256);
}

}  // namespace romap::slam::feature_test
