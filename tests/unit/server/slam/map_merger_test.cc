#include "server/slam/map_merger.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "tests/unit/server/slam/loop_world.h"

namespace romap::slam::map_merger_test {

constexpr uint64_t kIdsUsed = 5000;  // by the first map
constexpr LoopWorld::Drift kNoDrift{};

// The map of a room in world A, and a later map of a part of it in a world of its own.
class MapMergerTest : public ::testing::Test {
 protected:
  // World A to the world of the later map.
  const Sim3<World, World> S_other_a_{
      0.4, Eigen::Quaterniond(Eigen::AngleAxisd(2, Eigen::Vector3d(1, 2, 3).normalized())), Eigen::Vector3d(3, -7, 2)};

  void Begin(LoopWorld& world, const Sim3<World, World>& S = {}) {
    auto made = atlas_.MakeMap();
    if (world.map().keyframes().begin()->first.value > 1) world.map().Transform(S);
    made->map.Append(world.map());
    for (const auto& [id, keyframe] : made->map.keyframes()) made->places.Add(keyframe);
    made->newest = made->map.keyframes().rbegin()->first;
    atlas_.Begin(std::move(made));
  }

  // Begins a map of the whole room in world A.
  void BeginRoom(bool look_alike = false) {
    LoopWorld world(LoopWorld::kKeyframesPerRound, kNoDrift, {.opposite_walls_look_alike = look_alike});
    Begin(world);
  }
  // Begins a map with six keyframes of the round in a world of its own.
  void BeginOther(LoopWorld::Options options, LoopWorld::Drift drift = kNoDrift) {
    options.ids_used = kIdsUsed;
    LoopWorld world(6, drift, options);
    Begin(world, S_other_a_);
  }

  // Observes the first `keyframes` keyframes of the current map, and concludes the trial if there is one.
  std::optional<MapMerge> Observe(int keyframes) {
    for (const auto& [id, keyframe] : atlas_.current().map.keyframes()) {
      if (keyframes-- == 0) break;
      merger_.Observe(keyframe, atlas_);
    }
    return merger_.Conclude(/*wait=*/true, atlas_);
  }

  // Largest distance of a keyframe of the other map from its true position in world A.
  double LargestError_mu(int first) const {
    double largest = 0;
    int found = 0;
    for (const auto& [id, keyframe] : atlas_.current().map.keyframes()) {
      if (id.value <= kIdsUsed) continue;
      const int i = first + static_cast<int>(id.value - kIdsUsed) - 1;
      largest = std::max(largest, (keyframe.center_world() - LoopWorld::TruePose(i).translation()).norm());
      ++found;
    }
    return found > 0 ? largest : 1e9;
  }

  MapAtlas atlas_{SlamConfig{}};
  MapMerger merger_{SlamConfig{}, /*run_inline=*/true};
};

TEST_F(MapMergerTest, MergesTheSmallerMapIntoTheWorldOfTheLargerOne) {
  BeginRoom();
  BeginOther({.first = 10});
  const size_t points = atlas_.points();
  const auto merge = Observe(6);
  ASSERT_TRUE(merge);
  EXPECT_EQ(merge->from, SparseMapId{2});
  EXPECT_EQ(merge->into, SparseMapId{1});
  EXPECT_EQ(atlas_.maps(), 1U);
  EXPECT_EQ(atlas_.current().id, SparseMapId{1});
  EXPECT_EQ(atlas_.current().newest, KeyframeId{kIdsUsed + 6});
  EXPECT_EQ(atlas_.current().map.keyframes().size(), static_cast<size_t>(LoopWorld::kKeyframesPerRound + 6));
  EXPECT_LT(LargestError_mu(10), 0.05);
  EXPECT_LT(atlas_.points(), points - 100) << "points of both maps are the same";
}

TEST_F(MapMergerTest, TheCurrentMapStaysInItsWorldIfItIsLarger) {
  BeginOther({.first = 10});
  BeginRoom();
  const auto merge = Observe(LoopWorld::kKeyframesPerRound);
  ASSERT_TRUE(merge);
  EXPECT_EQ(merge->from, SparseMapId{1});
  EXPECT_EQ(merge->into, SparseMapId{2});
  EXPECT_EQ(atlas_.maps(), 1U);
  EXPECT_LT(LargestError_mu(10), 0.05);
}

TEST_F(MapMergerTest, TheMotionOfTheMovedMapIsReported) {
  BeginRoom();
  BeginOther({.first = 10});
  SessionMap& other = atlas_.current();
  for (const auto& [id, keyframe] : other.map.keyframes()) {
    KeyframeView view;
    view.id = id;
    view.T_world_camera = keyframe.T_world_camera();
    other.corrections.Record(view, keyframe.scale);
  }
  ASSERT_TRUE(Observe(6));
  SessionMap& merged = atlas_.current();
  const MapCorrection correction = merged.corrections.TakeCorrection(merged.map);
  ASSERT_EQ(correction.keyframes.size(), 6U);
  for (const KeyframeCorrection& keyframe : correction.keyframes) {
    EXPECT_NEAR(keyframe.S_new_old.scale(), 1 / S_other_a_.scale(), 0.02);
    const auto expected = S_other_a_.Inverse().rotation();
    EXPECT_LT(keyframe.S_new_old.rotation().angularDistance(expected), 0.01);
  }
}

TEST_F(MapMergerTest, TheKeyframesOfBothMapsBecomeOneTree) {
  BeginRoom();
  BeginOther({.first = 10});
  ASSERT_TRUE(Observe(6));
  int roots = 0;
  for (const auto& [id, keyframe] : atlas_.current().map.keyframes()) {
    EXPECT_LT(keyframe.parent, id);
    roots += keyframe.parent ? 0 : 1;
  }
  EXPECT_EQ(roots, 1);
}

TEST_F(MapMergerTest, TwoKeyframesAreNoProof) {
  BeginRoom();
  BeginOther({.first = 10});
  EXPECT_FALSE(Observe(2));
  EXPECT_EQ(atlas_.maps(), 2U);
}

// The keyframes find a wall, but each at another pose.
TEST_F(MapMergerTest, KeyframesThatDisagreeAreNoProof) {
  BeginRoom();
  BeginOther({.first = 10}, {.rotation_deg = 8});
  EXPECT_FALSE(Observe(6));
  EXPECT_EQ(atlas_.maps(), 2U);
}

TEST_F(MapMergerTest, APlaceThatLooksLikeTwoPlacesOfTheKeptMapIsNoProof) {
  BeginRoom(/*look_alike=*/true);
  BeginOther({.opposite_walls_look_alike = true, .first = 10});
  EXPECT_FALSE(Observe(6));
  EXPECT_EQ(atlas_.maps(), 2U);
}

TEST_F(MapMergerTest, APlaceThatLooksLikeTwoPlacesOfTheCurrentMapIsNoProof) {
  BeginOther({.opposite_walls_look_alike = true, .first = 10});
  BeginRoom(/*look_alike=*/true);
  EXPECT_FALSE(Observe(LoopWorld::kKeyframesPerRound));
  EXPECT_EQ(atlas_.maps(), 2U);
  EXPECT_GT(merger_.rejected(), 0) << "the place was not recognized at all";
}

// Only the upper parts of the walls look alike.
TEST_F(MapMergerTest, APlaceThatLooksAlikeInPartIsNoProof) {
  BeginRoom();
  BeginOther({.first = 10, .alike_above_mu = 0.9});
  const MapKeyframe& keyframe = atlas_.current().map.keyframes().begin()->second;
  ASSERT_TRUE(atlas_.kept()[0]->places.Locate(*keyframe.frame, *atlas_.kept()[0]->map.FindKeyframe(KeyframeId{11}), 1));
  EXPECT_FALSE(Observe(6));
  EXPECT_EQ(atlas_.maps(), 2U);
}

TEST_F(MapMergerTest, MapsOfDifferentPlacesAreNotMerged) {
  LoopWorld part(6, kNoDrift);
  Begin(part);
  BeginOther({.first = 15});
  EXPECT_FALSE(Observe(6));
}

TEST_F(MapMergerTest, ForgetsThePlacesOfAnEarlierMap) {
  BeginRoom();
  BeginOther({.first = 10});
  int observed = 0;
  for (const auto& [id, keyframe] : atlas_.current().map.keyframes()) {
    merger_.Observe(keyframe, atlas_);
    if (++observed % 2 == 0) merger_.Forget();
  }
  EXPECT_FALSE(merger_.Conclude(/*wait=*/true, atlas_));
}

}  // namespace romap::slam::map_merger_test
