// Objects of a session with several maps.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <vector>

#include "common/map_motion.h"
#include "server/objects/object_mapper.h"
#include "tests/support/synthetic_world.h"
#include "tests/unit/server/objects/small_world.h"

namespace romap::objects::several_maps_test {

using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr SparseMapId kFirst{1};
constexpr SparseMapId kSecond{2};
constexpr uint64_t kIdOffset = 100'000;  // between the ids of keyframes and points of two maps

// Maps the same table in several maps with unrelated worlds.
class SeveralMapsObjectsTest : public ::testing::Test {
 protected:
  // The world of the first map to that of the second one.
  const Sim3<World, World> S_second_first_{1.7, Eigen::Quaterniond(Eigen::AngleAxisd(1.2, Eigen::Vector3d::UnitZ())),
                                           Eigen::Vector3d(4, 1, 0)};

  void Map(SparseMapId map, int first, int last) {
    const Sim3<World, World> S = map == kSecond ? S_second_first_ : Sim3<World, World>();
    const uint64_t offset = map == kSecond ? kIdOffset : 0;
    for (int i = first; i < last; ++i) {
      TrackedFrame frame = world_.MakeFrame(i);
      KeyframeView keyframe = world_.MakeKeyframe(i, frame);
      frame.T_world_camera = S.Moved(frame.T_world_camera);
      frame.map = map;
      Take(mapper_.ObserveFrame(frame));
      if (!world_.IsKeyframe(i)) continue;
      keyframe.id = KeyframeId{keyframe.id.value + offset};
      keyframe.T_world_camera = S.Moved(keyframe.T_world_camera);
      for (MapPoint& point : keyframe.points) {
        point.id = MapPointId{point.id.value + offset};
        point.position_world = S * point.position_world;
        if (map == kSecond) points_[point.id] = point;
      }
      for (PointObservation& observation : keyframe.observations) {
        observation.point = MapPointId{observation.point.value + offset};
      }
      if (map == kSecond) poses_[keyframe.id] = keyframe.T_world_camera;
      Take(mapper_.ObserveKeyframe(keyframe));
    }
  }

  // The second map moves into the world of the first one.
  MapCorrection Merge() {
    const Sim3<World, World> S = S_second_first_.Inverse();
    MapCorrection correction;
    for (const auto& [id, T_world_camera] : poses_) {
      correction.keyframes.push_back({id, S.Moved(T_world_camera), S});
    }
    for (const auto& [id, point] : points_) {
      correction.points.push_back(point);
      correction.points.back().position_world = S * point.position_world;
    }
    correction.merged_maps.push_back({.from = kSecond, .into = kFirst});
    return correction;
  }

  void Take(const ObjectOutput& output) {
    for (const MapEvent& event : output.events) {
      if (const auto* update = std::get_if<ObjectUpdate>(&event)) {
        objects_[update->id] = *update;
        changed_.insert(update->id);
      } else if (const auto* removed = std::get_if<ObjectRemoved>(&event)) {
        objects_.erase(removed->id);
        changed_.insert(removed->id);
      } else if (const auto* merged = std::get_if<ObjectMerged>(&event)) {
        objects_.erase(merged->from);
        changed_.insert({merged->from, merged->into});
        ++merged_;
      }
    }
    for (const ObjectViews& views : output.views) changed_.insert(views.object);
  }

  std::vector<ObjectUpdate> ObjectsOf(SparseMapId map) const {
    std::vector<ObjectUpdate> objects;
    for (const auto& [id, object] : objects_) {
      if (object.map_id == map && object.state == ObjectState::kConfirmed) objects.push_back(object);
    }
    return objects;
  }

  const SyntheticWorld world_{SmallWorld()};
  ObjectMapper mapper_{ObjectsConfig{}};
  std::map<KeyframeId, SE3<World, Camera>> poses_;  // of the second map
  std::map<MapPointId, MapPoint> points_;
  std::map<ObjectId, ObjectUpdate> objects_;
  std::set<ObjectId> changed_;
  int merged_ = 0;
};

TEST_F(SeveralMapsObjectsTest, ObjectsOfAKeptMapStayAsTheyAre) {
  Map(kFirst, 0, 30);
  ASSERT_THAT(ObjectsOf(kFirst), SizeIs(4));
  const std::map<ObjectId, ObjectUpdate> before = objects_;
  changed_.clear();
  Map(kSecond, 0, 60);
  for (const auto& [id, object] : before) EXPECT_FALSE(changed_.contains(id)) << id;
  EXPECT_THAT(ObjectsOf(kFirst), SizeIs(4));
  EXPECT_THAT(ObjectsOf(kSecond), SizeIs(4)) << "whether they are the same objects is not known";
}

TEST_F(SeveralMapsObjectsTest, TheObjectsOfAMapContinueWhenTheCameraIsBack) {
  Map(kFirst, 0, 30);
  Map(kSecond, 0, 30);
  changed_.clear();
  const size_t count = objects_.size();
  Map(kFirst, 30, 60);
  EXPECT_EQ(objects_.size(), count) << "the objects of the first map were recognized";
  for (const ObjectUpdate& object : ObjectsOf(kSecond)) EXPECT_FALSE(changed_.contains(object.id)) << object.id;
  for (const ObjectUpdate& object : ObjectsOf(kFirst)) EXPECT_TRUE(changed_.contains(object.id)) << object.id;
}

TEST_F(SeveralMapsObjectsTest, AProvisionalLandmarkSurvivesALongTimeInAnotherMap) {
  Map(kFirst, 0, 5);
  const size_t provisional = objects_.size();
  ASSERT_GT(provisional, 0U);
  ASSERT_THAT(ObjectsOf(kFirst), IsEmpty());
  for (int round = 0; round < 8; ++round) Map(kSecond, 0, 60);  // pruned after 400 frames without an observation
  const size_t count = objects_.size();
  Map(kFirst, 5, 6);
  EXPECT_EQ(objects_.size(), count);
}

TEST_F(SeveralMapsObjectsTest, AMergeMovesTheObjectsAndMergesDuplicates) {
  Map(kFirst, 0, 30);
  const std::vector<ObjectUpdate> before = ObjectsOf(kFirst);
  Map(kSecond, 30, 60);
  ASSERT_THAT(ObjectsOf(kSecond), SizeIs(4));
  Take(mapper_.Correct(Merge()));
  EXPECT_THAT(ObjectsOf(kSecond), IsEmpty());
  EXPECT_EQ(merged_, 4);
  ASSERT_THAT(ObjectsOf(kFirst), SizeIs(4));
  for (const ObjectUpdate& object : before) {
    ASSERT_TRUE(objects_.contains(object.id)) << "the older object remains";
    EXPECT_GT(CuboidIou(objects_.at(object.id).cuboid, object.cuboid), 0.5) << object.id;
  }
}

TEST_F(SeveralMapsObjectsTest, AnObjectOfOneMapOnlyIsSentAgainWithItsNewMap) {
  Map(kSecond, 0, 30);
  const std::vector<ObjectUpdate> before = ObjectsOf(kSecond);
  ASSERT_THAT(before, SizeIs(4));
  Take(mapper_.Correct(Merge()));
  ASSERT_THAT(ObjectsOf(kFirst), SizeIs(4));
  for (const ObjectUpdate& object : before) {
    const Cuboid expected = Moved(S_second_first_.Inverse(), object.cuboid);
    EXPECT_LT(
        (objects_.at(object.id).cuboid.T_world_object.translation() - expected.T_world_object.translation()).norm(),
        1e-6);
  }
}

TEST_F(SeveralMapsObjectsTest, FinishPublishesTheObjectsOfAllMaps) {
  Map(kFirst, 0, 30);
  Map(kSecond, 0, 4);  // too few frames to confirm objects
  Take(mapper_.Finish());
  EXPECT_THAT(ObjectsOf(kFirst), SizeIs(4));
  for (const auto& [id, object] : objects_) EXPECT_NE(object.state, ObjectState::kProvisional) << id;
}

}  // namespace romap::objects::several_maps_test
