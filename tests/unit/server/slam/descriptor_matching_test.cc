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

TEST(FindNearest, FindsTheMostSimilarCandidateOfASimilarOctave) {
  std::mt19937_64 random(5);
  const Feature feature{.pixel_px = {0, 0}, .octave = 2, .descriptor = RandomDescriptor(random)};
  const auto similar = [&](int bits, int octave) {
    return Feature{.pixel_px = {0, 0}, .octave = octave, .descriptor = Flip(feature.descriptor, bits)};
  };
  const std::vector<Feature> others = {similar(5, 2), similar(20, 2), similar(10, 4), similar(40, 3)};
  const NearestFeature all = FindNearest(feature, others, std::vector<int>{0, 1, 2, 3}, /*max_octave_difference=*/1);
  EXPECT_EQ(all.index, 0);
  EXPECT_EQ(all.distance, 5);
  EXPECT_EQ(all.second_distance, 20);
  const NearestFeature some = FindNearest(feature, others, std::vector<int>{3, 1, 2}, /*max_octave_difference=*/1);
  EXPECT_EQ(some.index, 1);
  EXPECT_EQ(some.second_distance, 40);
  EXPECT_TRUE(some.IsDistinct(20, 0.5));
  EXPECT_FALSE(some.IsDistinct(19, 0.5));
  EXPECT_FALSE(some.IsDistinct(20, 0.49));
  EXPECT_FALSE(FindNearest(feature, others, {}, 1).IsDistinct(256, 1));
}

}  // namespace romap::slam::descriptor_matching_test
