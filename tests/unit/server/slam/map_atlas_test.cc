#include "server/slam/map_atlas.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "tests/unit/server/slam/loop_world.h"

namespace romap::slam::map_atlas_test {

class MapAtlasTest : public ::testing::Test {
 protected:
  // Begins a map with keyframes [first, first + count) of the room.
  void Begin(int first, int count) {
    auto made = atlas_.MakeMap();
    LoopWorld world(count, {}, {.ids_used = made->map.point_count(), .first = first});
    made->map.Append(world.map());
    for (const auto& [id, keyframe] : made->map.keyframes()) made->places.Add(keyframe);
    atlas_.Begin(std::move(made));
  }

  std::vector<std::string> WarningNames() const {
    std::vector<std::string> names;
    for (const Diagnostic& diagnostic : atlas_.Diagnostics()) names.push_back(diagnostic.code);
    return names;
  }

  MapAtlas atlas_{SlamConfig{}};
};

TEST_F(MapAtlasTest, StartsWithAnEmptyFirstMap) {
  EXPECT_TRUE(atlas_.current().IsEmpty());
  EXPECT_EQ(atlas_.current().id, SparseMapId{1});
  EXPECT_EQ(atlas_.maps(), 0U);
  EXPECT_EQ(atlas_.MakeMap()->id, SparseMapId{1});
}

TEST_F(MapAtlasTest, KeepsTheEarlierMapWhenANewOneBegins) {
  Begin(0, 4);
  const size_t points = atlas_.points();
  Begin(15, 4);
  EXPECT_EQ(atlas_.current().id, SparseMapId{2});
  EXPECT_EQ(atlas_.maps(), 2U);
  ASSERT_NE(atlas_.Find(SparseMapId{1}), nullptr);
  EXPECT_EQ(atlas_.Find(SparseMapId{1})->map.keyframes().size(), 4U);
  EXPECT_EQ(atlas_.Find(SparseMapId{1})->map.points().size(), points);
  EXPECT_GT(atlas_.points(), points);
}

TEST_F(MapAtlasTest, WarnsWhileThereAreSeveralMaps) {
  Begin(0, 4);
  auto names = WarningNames();
  EXPECT_EQ(std::count(names.begin(), names.end(), "maps_unconnected"), 0);
  Begin(15, 4);
  names = WarningNames();
  EXPECT_EQ(std::count(names.begin(), names.end(), "maps_unconnected"), 1);
}

TEST_F(MapAtlasTest, AFailedMapLeavesTheCurrentOneAndUsesUpItsIds) {
  Begin(0, 4);
  auto failed = atlas_.MakeMap();
  const uint64_t used = failed->map.keyframe_count() + 2;
  failed->map.SkipIds(used, 0);
  atlas_.Discard(std::move(failed));
  EXPECT_EQ(atlas_.current().id, SparseMapId{1});
  EXPECT_EQ(atlas_.current().map.keyframes().size(), 4U);
  EXPECT_EQ(atlas_.MakeMap()->map.keyframe_count(), used);
  EXPECT_EQ(atlas_.MakeMap()->id, SparseMapId{2});
}

TEST_F(MapAtlasTest, FindsTheCameraInAKeptMapAndReturnsToIt) {
  Begin(0, 4);
  Begin(15, 4);
  LoopWorld world(3, {});
  const auto place = atlas_.Relocalize(*world.newest().frame);
  ASSERT_TRUE(place);
  EXPECT_EQ(place->map, SparseMapId{1});
  const SE3<World, Camera> truth = LoopWorld::TruePose(2);
  EXPECT_LT((place->located.T_world_camera.translation() - truth.translation()).norm(), 0.05);

  const uint64_t keyframes = atlas_.current().map.keyframe_count();
  const uint64_t points = atlas_.current().map.point_count();
  atlas_.SwitchTo(place->map);
  EXPECT_EQ(atlas_.current().id, SparseMapId{1});
  EXPECT_EQ(atlas_.maps(), 2U);
  EXPECT_GE(atlas_.current().map.keyframe_count(), keyframes) << "ids must not be used twice";
  EXPECT_GE(atlas_.current().map.point_count(), points);
  EXPECT_EQ(atlas_.MakeMap()->id, SparseMapId{3});
}

TEST_F(MapAtlasTest, TheMergedMapIsCurrentIfOneOfThemWas) {
  Begin(0, 4);
  Begin(15, 4);
  Begin(8, 4);
  const size_t points = atlas_.points();
  atlas_.current().newest = atlas_.current().map.keyframes().rbegin()->first;
  const KeyframeId newest = atlas_.current().newest;
  atlas_.Merge({.from = SparseMapId{3}, .into = SparseMapId{1}});
  EXPECT_EQ(atlas_.current().id, SparseMapId{1});
  EXPECT_EQ(atlas_.current().newest, newest);
  EXPECT_EQ(atlas_.current().map.keyframes().size(), 8U);
  EXPECT_EQ(atlas_.maps(), 2U);
  EXPECT_EQ(atlas_.points(), points);
  EXPECT_EQ(atlas_.Find(SparseMapId{3}), nullptr);
  // Places of both parts are known.
  for (const int i : {2, 10}) {
    LoopWorld world(1, {}, {.first = i});
    const auto place = atlas_.Relocalize(*world.newest().frame);
    ASSERT_TRUE(place) << i;
    EXPECT_EQ(place->map, SparseMapId{1}) << i;
  }

  atlas_.Merge({.from = SparseMapId{2}, .into = SparseMapId{1}});
  EXPECT_EQ(atlas_.current().newest, newest) << "the camera was not in the merged map";
  EXPECT_EQ(atlas_.maps(), 1U);
}

}  // namespace romap::slam::map_atlas_test
