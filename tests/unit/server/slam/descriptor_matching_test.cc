#include "server/slam/descriptor_matching.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/unit/server/slam/random_descriptor.h"

namespace romap::slam::descriptor_matching_test {

TEST(MatchDescriptors, FindsMutualBestMatchesWithinTheLimits) {
  std::mt19937_64 random(3);
  std::vector<Descriptor> first, second;
  for (int i = 0; i < 40; ++i) first.push_back(RandomDescriptor(random));
  for (int i = 39; i >= 0; --i) second.push_back(Flip(first[static_cast<size_t>(i)], i < 20 ? 10 : 70));
  const auto matches = MatchDescriptors(first, second, 50, 0.8);
  ASSERT_EQ(matches.size(), 20U);
  for (const DescriptorMatch& match : matches) {
    EXPECT_EQ(match.second, 39 - match.first);
    EXPECT_EQ(match.distance,
              HammingDistance(first[static_cast<size_t>(match.first)], second[static_cast<size_t>(match.second)]));
  }
  second.push_back(Flip(first[0], 11));  // a second candidate for first[0]
  EXPECT_EQ(MatchDescriptors(first, second, 50, 0.8).size(), 19U);
  EXPECT_TRUE(MatchDescriptors({}, second, 50, 0.8).empty());
  EXPECT_TRUE(MatchDescriptors(first, {}, 50, 0.8).empty());
}

}  // namespace romap::slam::descriptor_matching_test
