#include "server/slam/places/place_index.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

namespace romap::slam::place_index_test {

using ::testing::Field;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// Places are lists of random descriptors. A view of a place contains part of them, with flipped bits, and clutter.
class PlaceIndexTest : public ::testing::Test {
 protected:
  std::vector<Feature> MakePlace(int features) {
    std::vector<Feature> place(static_cast<size_t>(features));
    for (Feature& feature : place) {
      for (uint64_t& word : feature.descriptor) word = random_();
    }
    return place;
  }

  std::vector<Feature> View(const std::vector<Feature>& place, double seen_share, double flipped_share) {
    std::bernoulli_distribution seen(seen_share);
    std::bernoulli_distribution flipped(flipped_share);
    std::vector<Feature> view;
    for (const Feature& feature : place) {
      view.push_back(seen(random_) ? feature : MakePlace(1)[0]);
      for (uint64_t& word : view.back().descriptor) {
        for (int bit = 0; bit < 64; ++bit) word ^= uint64_t{flipped(random_)} << bit;
      }
    }
    return view;
  }

  // Adds `count` places of 300 features as keyframes 1, 2, ...
  std::vector<std::vector<Feature>> AddPlaces(PlaceIndex& index, int count) {
    std::vector<std::vector<Feature>> places;
    for (int i = 0; i < count; ++i) {
      places.push_back(MakePlace(300));
      index.Add(KeyframeId{places.size()}, places.back());
    }
    return places;
  }

  std::mt19937_64 random_{11};
};

TEST_F(PlaceIndexTest, EmptyIndexReturnsNothing) {
  PlaceIndex index;
  EXPECT_THAT(index.Query(MakePlace(100), 3), IsEmpty());
  index.Remove(KeyframeId{7});
  index.Add(KeyframeId{1}, {});
  EXPECT_EQ(index.size(), 1u);
  EXPECT_THAT(index.Query(MakePlace(100), 3), IsEmpty());
  EXPECT_THAT(index.Query({}, 3), IsEmpty());
}

TEST_F(PlaceIndexTest, FindsAPlaceFromAnotherView) {
  PlaceIndex index;
  const auto places = AddPlaces(index, 60);
  for (const size_t place : {size_t{0}, size_t{17}, size_t{59}}) {
    SCOPED_TRACE(place);
    const auto matches = index.Query(View(places[place], 0.4, 0.1), 3);
    ASSERT_FALSE(matches.empty());
    EXPECT_EQ(matches[0].keyframe, KeyframeId{place + 1});
    if (matches.size() > 1) {
      EXPECT_GT(matches[0].score, 5 * matches[1].score);
    }
  }
}

TEST_F(PlaceIndexTest, RanksViewsBySharedFeatures) {
  PlaceIndex index;
  AddPlaces(index, 20);
  const auto place = MakePlace(300);
  index.Add(KeyframeId{101}, View(place, 0.3, 0.08));
  index.Add(KeyframeId{102}, View(place, 0.9, 0.08));
  index.Add(KeyframeId{103}, View(place, 0.6, 0.08));
  const auto matches = index.Query(place, 3);
  EXPECT_THAT(matches, testing::ElementsAre(Field(&PlaceMatch::keyframe, KeyframeId{102}),
                                            Field(&PlaceMatch::keyframe, KeyframeId{103}),
                                            Field(&PlaceMatch::keyframe, KeyframeId{101})));
  EXPECT_THAT(index.Query(place, 1), SizeIs(1));
  EXPECT_THAT(index.Query(place, 0), IsEmpty());
}

TEST_F(PlaceIndexTest, SameImageScoresAboutOneAndUnrelatedImageAboutZero) {
  PlaceIndex index;
  const auto places = AddPlaces(index, 20);
  const auto matches = index.Query(places[4], 2);
  ASSERT_FALSE(matches.empty());
  EXPECT_EQ(matches[0].keyframe, KeyframeId{5});
  EXPECT_GT(matches[0].score, 0.95);
  EXPECT_LE(matches[0].score, 1.0);
  for (const PlaceMatch& match : index.Query(MakePlace(300), 3)) EXPECT_LT(match.score, 0.01);
}

TEST_F(PlaceIndexTest, CommonFeaturesHaveLowWeight) {
  PlaceIndex index;
  const auto common_features = MakePlace(200);  // for example a logo in every image
  std::vector<std::vector<Feature>> places;
  for (uint64_t i = 1; i <= 30; ++i) {
    places.push_back(MakePlace(40));
    auto features = View(places.back(), 1, 0.05);
    // The queried place shows the logo least clearly. Ranked only by the number of similar features, it would be last.
    const auto logo = View(common_features, i == 3 ? 0.5 : 1, 0.02);
    features.insert(features.end(), logo.begin(), logo.end());
    index.Add(KeyframeId{i}, features);
  }
  auto query = View(places[2], 1, 0.05);
  query.insert(query.end(), common_features.begin(), common_features.end());
  const auto matches = index.Query(query, 30);
  ASSERT_FALSE(matches.empty());
  EXPECT_EQ(matches[0].keyframe, KeyframeId{3});
  ASSERT_GT(matches.size(), 1u);
  EXPECT_GT(matches[0].score, 3 * matches[1].score);
}

TEST_F(PlaceIndexTest, ManyFeaturesDoNotIncreaseTheScore) {
  PlaceIndex index;
  AddPlaces(index, 20);
  const auto place = MakePlace(200);
  const auto sparse = View(place, 0.5, 0.08);
  auto full = View(place, 0.5, 0.08);
  const auto clutter = MakePlace(800);
  full.insert(full.end(), clutter.begin(), clutter.end());
  index.Add(KeyframeId{101}, sparse);
  index.Add(KeyframeId{102}, full);
  const auto matches = index.Query(place, 2);
  ASSERT_THAT(matches, SizeIs(2));
  EXPECT_EQ(matches[0].keyframe, KeyframeId{101});
}

TEST_F(PlaceIndexTest, RemovedKeyframesAreNotReturned) {
  PlaceIndex index;
  const auto places = AddPlaces(index, 30);
  // Enough to trigger a sweep: some of these are removed from the tree, others are only ignored.
  for (uint64_t id = 3; id <= 14; ++id) index.Remove(KeyframeId{id});
  EXPECT_EQ(index.size(), 18u);
  for (size_t place = 0; place < places.size(); ++place) {
    SCOPED_TRACE(place);
    const auto matches = index.Query(places[place], 1);
    const bool removed = place + 1 >= 3 && place + 1 <= 14;
    EXPECT_EQ(!matches.empty() && matches[0].score > 0.5, !removed);
    for (const PlaceMatch& match : matches)
      EXPECT_TRUE(match.keyframe < KeyframeId{3} || match.keyframe > KeyframeId{14});
  }
}

TEST_F(PlaceIndexTest, AddingAKeyframeAgainReplacesItsFeatures) {
  PlaceIndex index;
  const auto places = AddPlaces(index, 10);
  const auto moved = MakePlace(300);
  index.Add(KeyframeId{4}, moved);
  EXPECT_EQ(index.size(), 10u);
  ASSERT_FALSE(index.Query(moved, 1).empty());
  EXPECT_EQ(index.Query(moved, 1)[0].keyframe, KeyframeId{4});
  for (const PlaceMatch& match : index.Query(places[3], 10)) EXPECT_NE(match.keyframe, KeyframeId{4});
}

TEST_F(PlaceIndexTest, MemoryDoesNotGrowWithRemovedKeyframes) {
  PlaceIndex index;
  AddPlaces(index, 40);
  const size_t full_bytes = index.bytes();
  EXPECT_LT(full_bytes, 40u * 300u * 100u);
  // A map that culls as many keyframes as it adds keeps its size.
  for (uint64_t id = 1; id <= 200; ++id) {
    index.Remove(KeyframeId{id});
    index.Add(KeyframeId{id + 40}, MakePlace(300));
  }
  EXPECT_EQ(index.size(), 40u);
  EXPECT_LT(index.bytes(), 3 * full_bytes);
}

TEST_F(PlaceIndexTest, IsDeterministicForASeed) {
  PlaceIndex first(5);
  PlaceIndex second(5);
  std::vector<std::vector<Feature>> places;
  for (uint64_t id = 1; id <= 20; ++id) {
    places.push_back(MakePlace(200));
    first.Add(KeyframeId{id}, places.back());
    second.Add(KeyframeId{id}, places.back());
  }
  const auto query = View(places[7], 0.5, 0.12);
  const auto a = first.Query(query, 5);
  const auto b = second.Query(query, 5);
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].keyframe, b[i].keyframe);
    EXPECT_EQ(a[i].score, b[i].score);
  }
}

}  // namespace romap::slam::place_index_test
