// Corrections of the map: objects move with the keyframes that observed them.

#include "server/objects/correction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "common/map_motion.h"
#include "server/objects/object_mapper.h"
#include "server/objects/projection.h"
#include "tests/support/synthetic_world.h"
#include "tests/unit/server/objects/small_world.h"

namespace romap::objects::correction_test {

using ::testing::IsEmpty;
using ::testing::SizeIs;

// A mapper with its input and its published output.
class CorrectedMapping {
 public:
  explicit CorrectedMapping(const SyntheticWorldOptions& options) : world(options) {}

  // Maps frames [first, last) in a world that was moved by `S`.
  void Map(int first, int last, const Sim3<World, World>& S = {}) {
    for (int i = first; i < last; ++i) {
      TrackedFrame frame = world.MakeFrame(i);
      KeyframeView keyframe = world.MakeKeyframe(i, frame);
      frame.T_world_camera = S.Moved(frame.T_world_camera);
      frame.up_world = S.rotation() * frame.up_world;
      Take(mapper.ObserveFrame(frame));
      if (!world.IsKeyframe(i)) continue;
      keyframe.T_world_camera = S.Moved(keyframe.T_world_camera);
      keyframe.up_world = S.rotation() * keyframe.up_world;
      for (MapPoint& point : keyframe.points) {
        point.position_world = S * point.position_world;
        points[point.id] = point;
      }
      poses[keyframe.id] = keyframe.T_world_camera;
      Take(mapper.ObserveKeyframe(keyframe));
    }
  }

  // A correction of all keyframes and points.
  MapCorrection CorrectionOfAll(const Sim3<World, World>& S) {
    MapCorrection correction;
    for (auto& [id, T_world_camera] : poses) {
      T_world_camera = S.Moved(T_world_camera);
      correction.keyframes.push_back({id, T_world_camera, S});
    }
    for (auto& [id, point] : points) {
      point.position_world = S * point.position_world;
      correction.points.push_back(point);
    }
    correction.up_world = S.rotation() * up_world;
    up_world = correction.up_world;
    return correction;
  }

  void Take(const ObjectOutput& output) {
    last = output;
    for (const MapEvent& event : output.events) {
      if (const auto* update = std::get_if<ObjectUpdate>(&event)) {
        objects[update->id] = *update;
        ++updates;
      }
      if (const auto* merged = std::get_if<ObjectMerged>(&event)) objects.erase(merged->from);
    }
    for (const ObjectViews& published : output.views) {
      if (published.S_new_old) S_published[published.object] = *published.S_new_old * S_published[published.object];
      for (const ObjectView& view : published.new_views) views[published.object].push_back(view.keyframe);
    }
  }

  SyntheticWorld world;
  ObjectMapper mapper{ObjectsConfig{}};
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();
  std::map<KeyframeId, SE3<World, Camera>> poses;
  std::map<MapPointId, MapPoint> points;
  ObjectOutput last;
  std::map<ObjectId, ObjectUpdate> objects;
  std::map<ObjectId, std::vector<KeyframeId>> views;
  std::map<ObjectId, Sim3<World, World>> S_published;  // product of all motions
  int updates = 0;
};

void ExpectSame(const Sim3<World, World>& a, const Sim3<World, World>& b, const Eigen::Vector3d& at, double tolerance) {
  EXPECT_NEAR(a.scale(), b.scale(), tolerance);
  EXPECT_LT(a.rotation().angularDistance(b.rotation()), tolerance);
  EXPECT_LT((a * at - b * at).norm(), tolerance);
}

void ExpectSame(const Cuboid& a, const Cuboid& b) {
  EXPECT_LT((a.T_world_object.translation() - b.T_world_object.translation()).norm(), 1e-6);
  EXPECT_LT(a.T_world_object.rotation().angularDistance(b.T_world_object.rotation()), 1e-6);
  EXPECT_LT((a.half_extents - b.half_extents).norm(), 1e-6);
}

Sim3<World, World> LoopClosure() {
  return {1.3, Eigen::Quaterniond(Eigen::AngleAxisd(0.35, Eigen::Vector3d::UnitZ())), {2, -1, 0.5}};
}

TEST(ObjectCorrection, ALoopClosureMovesEveryObject) {
  CorrectedMapping run(SmallWorld());
  run.Map(0, 30);
  ASSERT_THAT(run.objects, SizeIs(4));
  const std::map<ObjectId, ObjectUpdate> before = run.objects;
  run.Take(run.mapper.Correct(run.CorrectionOfAll(LoopClosure())));
  EXPECT_THAT(run.last.events, SizeIs(4));
  ASSERT_THAT(run.last.views, SizeIs(4));
  for (const auto& [id, object] : before) {
    ExpectSame(run.objects.at(id).cuboid, Moved(LoopClosure(), object.cuboid));
  }
  for (const ObjectViews& published : run.last.views) {
    ASSERT_TRUE(published.S_new_old.has_value());
    ExpectSame(*published.S_new_old, LoopClosure(), before.at(published.object).cuboid.T_world_object.translation(),
               1e-6);
    EXPECT_THAT(published.new_views, IsEmpty()) << "sent views are not sent again";
    EXPECT_THAT(published.corrected_views, IsEmpty()) << "the views moved with the object";
    // The training box contains the published cuboid.
    EXPECT_EQ(ContainedShare(published.cuboid, CuboidCorners(run.objects.at(published.object).cuboid), 1.001), 1);
  }
}

TEST(ObjectCorrection, MappingContinuesInTheCorrectedWorld) {
  CorrectedMapping run(SmallWorld());
  run.Map(0, 30);
  run.Take(run.mapper.Correct(run.CorrectionOfAll(LoopClosure())));
  run.Map(30, 60, LoopClosure());
  run.Take(run.mapper.Finish());
  CorrectedMapping uncorrected(SmallWorld());
  uncorrected.Map(0, 60);
  uncorrected.Take(uncorrected.mapper.Finish());
  ASSERT_THAT(run.objects, SizeIs(4));
  for (const auto& [id, object] : run.objects) {
    EXPECT_GT(CuboidIou(object.cuboid, Moved(LoopClosure(), uncorrected.objects.at(id).cuboid)), 0.95) << id;
    EXPECT_EQ(run.views.at(id), uncorrected.views.at(id)) << "the same views were picked";
    const std::set<KeyframeId> distinct(run.views.at(id).begin(), run.views.at(id).end());
    EXPECT_EQ(distinct.size(), run.views.at(id).size());
  }
}

TEST(ObjectCorrection, ObjectsStayUprightWhenTheWorldIsAlignedWithGravity) {
  CorrectedMapping run(SmallWorld());
  run.Map(0, 30);
  const std::map<ObjectId, ObjectUpdate> before = run.objects;
  const Sim3<World, World> S(1, Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 0).normalized())),
                             {0, 0, 0});
  run.Take(run.mapper.Correct(run.CorrectionOfAll(S)));
  for (const auto& [id, object] : before) ExpectSame(run.objects.at(id).cuboid, Moved(S, object.cuboid));
  run.Map(30, 44, S);
  for (const auto& [id, object] : run.objects) {
    EXPECT_GT(object.cuboid.T_world_object.RotationMatrix().col(2).dot(run.up_world), 0.999999) << id;
  }

  // Only up changes: cuboids rotate upright but do not move.
  MapCorrection tilt;
  tilt.up_world = Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitX())) * run.up_world;
  run.Take(run.mapper.Correct(tilt));
  for (const auto& [id, object] : run.objects) {
    EXPECT_GT(object.cuboid.T_world_object.RotationMatrix().col(2).dot(tilt.up_world), 0.999999) << id;
  }
}

TEST(ObjectCorrection, SmallCorrectionsAddUpUntilTheyArePublished) {
  CorrectedMapping run(SmallWorld());
  run.Map(0, 30);
  const std::map<ObjectId, ObjectUpdate> before = run.objects;
  run.updates = 0;
  // A thousandth of the smaller objects' size at a time.
  const Sim3<World, World> little(1.0001, Eigen::Quaterniond::Identity(), {0.0001, 0, 0});
  Sim3<World, World> total;
  for (int i = 0; i < 40; ++i) {
    run.Take(run.mapper.Correct(run.CorrectionOfAll(little)));
    total = little * total;
  }
  EXPECT_GT(run.updates, 4);
  EXPECT_LT(run.updates, 4 * 20);
  for (const auto& [id, object] : before) {
    const Cuboid now = Moved(total, object.cuboid);
    const double size = 2 * now.half_extents.maxCoeff();
    const Eigen::Vector3d error =
        run.objects.at(id).cuboid.T_world_object.translation() - now.T_world_object.translation();
    EXPECT_LE(error.norm(), 0.005 * size) << id;
  }
  run.Take(run.mapper.Finish());
  for (const auto& [id, object] : before) {
    ExpectSame(run.S_published.at(id), total, object.cuboid.T_world_object.translation(), 1e-9);
  }
}

TEST(ObjectCorrection, OnlyTheViewThatMovedRelativeToTheObjectIsCorrected) {
  CorrectedMapping run(SmallWorld());
  run.Map(0, 60);
  ASSERT_THAT(run.objects, SizeIs(4));
  const KeyframeId wrong = run.views.begin()->second[2];
  const SE3<World, Camera> T_old = run.poses.at(wrong);
  const SE3<Camera, Camera> turn(Eigen::Quaterniond(Eigen::AngleAxisd(0.006, Eigen::Vector3d::UnitY())),
                                 Eigen::Vector3d::Zero());
  const SE3<World, Camera> T_new = T_old * turn;
  MapCorrection correction;
  correction.keyframes.push_back({wrong, T_new, Sim3<World, World>(T_new * T_old.Inverse())});
  run.Take(run.mapper.Correct(correction));
  size_t corrected = 0;
  for (const ObjectViews& published : run.last.views) {
    for (const ViewPose& pose : published.corrected_views) {
      EXPECT_EQ(pose.keyframe, wrong);
      EXPECT_TRUE(pose.T_world_camera.Matrix().isApprox(T_new.Matrix(), 1e-12));
      ++corrected;
    }
    EXPECT_THAT(published.new_views, IsEmpty());
  }
  EXPECT_GE(corrected, 1u);
  // Published once; no change is left.
  correction.keyframes[0].S_new_old = {};
  run.Take(run.mapper.Correct(correction));
  EXPECT_THAT(run.last.views, IsEmpty());
}

TEST(ObjectCorrection, IgnoresCorrectionsThatAreNotFinite) {
  CorrectedMapping run(SmallWorld());
  run.Map(0, 20);
  MapCorrection correction;
  const Eigen::Vector3d nan = Eigen::Vector3d::Constant(NAN);
  for (const auto& [id, T_world_camera] : run.poses) {
    correction.keyframes.push_back({id, {Eigen::Quaterniond::Identity(), nan}, LoopClosure()});
    correction.keyframes.push_back({id, T_world_camera, {0, Eigen::Quaterniond::Identity(), {1, 1, 1}}});
  }
  for (const auto& [id, point] : run.points) correction.points.push_back({id, nan});
  correction.up_world = nan;
  run.Take(run.mapper.Correct(correction));
  EXPECT_THAT(run.last.events, IsEmpty());
  EXPECT_THAT(run.last.views, IsEmpty());
}

TEST(MeanMotion, AveragesTheMotionsAtTheCenter) {
  const KeyframeId a{1}, b{2}, other{3};
  const Eigen::Vector3d center(1, 2, 3);
  const Sim3<World, World> S(4, Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ())), {7, 0, 0});
  const KeyframeCorrections corrections{{b, {b, {}, S}}};
  EXPECT_FALSE(MeanMotion(std::vector{a, other}, center, corrections).has_value());
  ExpectSame(*MeanMotion(std::vector{b}, center, corrections), S, center, 1e-12);
  const Sim3<World, World> half = *MeanMotion(std::vector{a, b}, center, corrections);
  EXPECT_NEAR(half.scale(), 2, 1e-12);
  EXPECT_NEAR(half.rotation().angularDistance(Eigen::Quaterniond::Identity()), 0.2, 1e-12);
  EXPECT_TRUE((half * center).isApprox((center + S * center) / 2, 1e-12));
}

}  // namespace romap::objects::correction_test
