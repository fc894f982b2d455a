#include "server/slam/slam_map.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "server/slam/correction_log.h"
#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::slam_map_test {

// Keyframes on a line along x that observe the same points.
class SlamMapTest : public ::testing::Test {
 protected:
  static constexpr size_t kFeatures = 30;

  MapKeyframe& AddKeyframe(double x) {
    Frame frame;
    frame.camera = TexturedWorld().camera();
    std::vector<Feature> features(kFeatures);
    for (size_t i = 0; i < kFeatures; ++i) {
      features[i].pixel_px = Eigen::Vector2f(10 + 8.0F * static_cast<float>(i), 100);
      features[i].descriptor = {i, i, i, i};
    }
    return map_.AddKeyframe(MakeFrameFeatures(frame, features),
                            {Eigen::Quaterniond::Identity(), Eigen::Vector3d(x, 0, 0)});
  }

  PointTrack& AddPoint(int feature, std::initializer_list<MapKeyframe*> keyframes) {
    PointTrack& track = map_.AddPoint({0.1 * feature, 0, 5});
    for (MapKeyframe* keyframe : keyframes) EXPECT_TRUE(map_.AddObservation(track, *keyframe, feature));
    map_.Refresh(track);
    return track;
  }

  // The points of the keyframes and the observations of the points agree.
  void ExpectConsistent() const {
    size_t from_keyframes = 0, from_points = 0;
    for (const auto& [id, keyframe] : map_.keyframes()) {
      for (size_t i = 0; i < keyframe.points.size(); ++i) {
        if (!keyframe.points[i]) continue;
        ++from_keyframes;
        const auto it = map_.points().find(keyframe.points[i]);
        ASSERT_NE(it, map_.points().end());
        EXPECT_TRUE(std::any_of(it->second.observations.begin(), it->second.observations.end(),
                                [&](const FeatureRef& observation) {
                                  return observation.keyframe == id && observation.feature == static_cast<int>(i);
                                }));
      }
    }
    for (const auto& [id, track] : map_.points()) {
      from_points += track.observations.size();
      EXPECT_EQ(track.point.observations, static_cast<int>(track.observations.size()));
    }
    EXPECT_EQ(from_keyframes, from_points);
  }

  SlamMap map_{SlamConfig{}};
};

TEST_F(SlamMapTest, RejectsASecondPointPerFeatureAndASecondFeaturePerPoint) {
  MapKeyframe& a = AddKeyframe(0);
  MapKeyframe& b = AddKeyframe(1);
  PointTrack& first = AddPoint(3, {&a, &b});
  PointTrack& second = AddPoint(4, {&a, &b});
  EXPECT_FALSE(map_.AddObservation(second, a, 3));
  EXPECT_FALSE(map_.AddObservation(first, a, 7));
  ExpectConsistent();
}

TEST_F(SlamMapTest, RemovesPointsWithOnlyOneObservationLeft) {
  MapKeyframe& a = AddKeyframe(0);
  MapKeyframe& b = AddKeyframe(1);
  const MapPointId id = AddPoint(3, {&a, &b}).point.id;
  map_.RemoveObservation(id, b.id);
  EXPECT_EQ(map_.FindPoint(id), nullptr);
  EXPECT_EQ(map_.TakeRemovedPoints(), std::vector<MapPointId>{id});
  EXPECT_FALSE(a.points[3]);
  ExpectConsistent();
}

TEST_F(SlamMapTest, MergedPointsAreFoundByBothIds) {
  MapKeyframe& a = AddKeyframe(0);
  MapKeyframe& b = AddKeyframe(1);
  MapKeyframe& c = AddKeyframe(2);
  const MapPointId from = AddPoint(3, {&a, &b}).point.id;
  const MapPointId into = AddPoint(4, {&b, &c}).point.id;
  map_.MergePoints(from, into);
  ASSERT_NE(map_.FindPoint(from), nullptr);
  EXPECT_EQ(map_.FindPoint(from)->point.id, into);
  EXPECT_EQ(map_.FindPoint(into)->observations.size(), 3U);  // b observed both points; one of its observations remains
  ExpectConsistent();
}

TEST_F(SlamMapTest, CovisibilityCountsSharedPoints) {
  MapKeyframe& a = AddKeyframe(0);
  MapKeyframe& b = AddKeyframe(1);
  MapKeyframe& c = AddKeyframe(2);
  for (int i = 0; i < 10; ++i) AddPoint(i, {&a, &b});
  for (int i = 10; i < 14; ++i) AddPoint(i, {&a, &c});
  const std::vector<std::pair<KeyframeId, int>> expected = {{b.id, 10}, {c.id, 4}};
  EXPECT_EQ(map_.Covisible(a, 1), expected);
  EXPECT_EQ(map_.Covisible(a, 5).size(), 1U);
  EXPECT_TRUE(map_.Covisible(b, 11).empty());
}

TEST_F(SlamMapTest, RemovedKeyframeMovesWithItsParent) {
  MapKeyframe& a = AddKeyframe(0);
  MapKeyframe& b = AddKeyframe(1);
  b.parent = a.id;
  const KeyframeId removed = b.id;
  map_.RemoveKeyframe(removed);
  EXPECT_EQ(map_.FindKeyframe(removed), nullptr);
  // Scale the map by two and rotate it by 90 degrees around z.
  map_.keyframes().begin()->second.uncertainty = {.position_sigma_mu = 0.25, .rotation_sigma_rad = 0.5};
  map_.Transform({2, Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ())),
                  Eigen::Vector3d(0, 0, 1)});
  EXPECT_EQ(map_.keyframes().begin()->second.uncertainty, (PoseUncertainty{0.5, 0.5}));
  const auto pose = map_.KeyframePose(removed);
  ASSERT_TRUE(pose);
  EXPECT_LT((pose->T_world_camera.translation() - Eigen::Vector3d(0, 2, 1)).norm(), 1e-9);
  EXPECT_DOUBLE_EQ(pose->scale, 2);
  EXPECT_FALSE(map_.KeyframePose(KeyframeId{77}));
}

TEST_F(SlamMapTest, CorrectionLogReportsEachMotionOnceAndAccumulatesSmallOnes) {
  MapKeyframe& a = AddKeyframe(0);
  MapKeyframe& b = AddKeyframe(1);
  KeyframeView view;
  for (int i = 0; i < 5; ++i) view.points.push_back(AddPoint(i, {&a, &b}).point);
  view.id = b.id;
  view.T_world_camera = b.T_world_camera();
  CorrectionLog log;
  log.Record(view, b.scale);
  EXPECT_TRUE(log.TakeCorrection(map_).keyframes.empty());

  int reported = 0;
  for (int i = 0; i < 20; ++i) {  // each step is too small to report
    map_.Transform({1, Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.0005, 0, 0)});
    reported += static_cast<int>(log.TakeCorrection(map_).keyframes.size());
  }
  EXPECT_GE(reported, 2);
  EXPECT_LE(reported, 10);

  map_.Transform({1.5, Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())), {1, 2, 3}});
  const SE3<World, Camera> before = b.T_world_camera();
  const MapCorrection correction = log.TakeCorrection(map_);
  ASSERT_EQ(correction.keyframes.size(), 1U);
  EXPECT_EQ(correction.points.size(), 5U);
  EXPECT_NEAR(correction.keyframes[0].S_new_old.scale(), 1.5, 1e-9);
  EXPECT_LT((correction.keyframes[0].T_world_camera.translation() - before.translation()).norm(), 1e-9);
  EXPECT_TRUE(log.TakeCorrection(map_).keyframes.empty());
}

TEST_F(SlamMapTest, LensCorrectionAppliesToOldAndNewKeyframes) {
  const RadialCorrection lens{-0.05};
  MapKeyframe& before = AddKeyframe(0);
  const Eigen::Vector2f image_px = before.features()[0].pixel_px;
  map_.CorrectLens(lens);
  MapKeyframe& after = AddKeyframe(1);
  for (const MapKeyframe* keyframe : {&before, &after}) {
    const Eigen::Vector2d pixel_px = keyframe->features()[0].pixel_px.cast<double>();
    EXPECT_GT((pixel_px - image_px.cast<double>()).norm(), 1);
    EXPECT_LT((lens.Distort(keyframe->camera(), pixel_px) - image_px.cast<double>()).norm(), 0.01);
    EXPECT_EQ(keyframe->frame->image_px[0], image_px);
    EXPECT_LT((keyframe->camera().Project(keyframe->frame->bearings_camera[0]) - pixel_px).norm(), 0.01);
    std::vector<int> near;
    keyframe->frame->grid.Near(pixel_px, 1, near);
    EXPECT_NE(std::find(near.begin(), near.end(), 0), near.end());
  }
  EXPECT_EQ(UncorrectedFeatures(*after.frame)[0].pixel_px, image_px);
  // Corrections start from the pixels of the image and do not accumulate.
  map_.CorrectLens({});
  EXPECT_LT((before.features()[0].pixel_px - image_px).norm(), 1e-3);
}

// A removed keyframe and a merged point of the other map are known after it was added, and its frames get the lens
// correction of this map.
TEST_F(SlamMapTest, AppendsAnotherMapOfTheSession) {
  const RadialCorrection lens{-0.05};
  SlamMap other = [&] {
    MapKeyframe& first = AddKeyframe(0);
    MapKeyframe& second = AddKeyframe(1);
    second.parent = first.id;
    MapKeyframe& third = AddKeyframe(2);
    third.parent = second.id;
    for (int i = 0; i < 5; ++i) AddPoint(i, {&first, &second, &third});
    PointTrack& duplicate = AddPoint(6, {&first, &third});
    PointTrack& original = AddPoint(7, {&first, &third});
    map_.MergePoints(duplicate.point.id, original.point.id);
    map_.RemoveKeyframe(second.id);
    return map_;
  }();
  const MapPointId merged{6}, original{7};
  SlamMap map(SlamConfig{}, other.keyframe_count(), other.point_count());
  map.CorrectLens(lens);
  map.AddKeyframe(other.keyframes().begin()->second.frame, {});
  other.Transform(Sim3<World, World>(2.0, Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 1, 0)));
  map.Append(other);
  EXPECT_EQ(map.keyframes().size(), 3U);
  EXPECT_EQ(map.points().size(), 6U);
  ASSERT_NE(map.FindPoint(merged), nullptr);
  EXPECT_EQ(map.FindPoint(merged)->point.id, original);
  const auto removed = map.KeyframePose(KeyframeId{2});
  ASSERT_TRUE(removed);
  EXPECT_LT((removed->T_world_camera.translation() - Eigen::Vector3d(2, 1, 0)).norm(), 1e-9);
  EXPECT_EQ(removed->scale, 2);
  for (const auto& [id, keyframe] : map.keyframes()) EXPECT_EQ(keyframe.frame->lens.k1, lens.k1) << id;
  map.SkipIds(100, 200);
  EXPECT_EQ(map.AddPoint({0, 0, 1}).point.id, MapPointId{201});
  EXPECT_EQ(map.AddKeyframe(other.keyframes().begin()->second.frame, {}).id, KeyframeId{101});
}

}  // namespace romap::slam::slam_map_test
