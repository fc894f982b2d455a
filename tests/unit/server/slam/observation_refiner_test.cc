#include "server/slam/observation_refiner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "common/statistics.h"
#include "server/slam/features/feature_extractor.h"
#include "server/slam/point_maker.h"
#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::observation_refiner_test {

// Two keyframes of the textured world at their true poses, with points by parallax and detected pixels.
class ObservationRefinerTest : public ::testing::Test {
 protected:
  ObservationRefinerTest() {
    for (const double angle_deg : {0.0, 5.0}) AddKeyframe(angle_deg);
    PointMaker maker(config_, &map_);
    maker.MakePointsByParallax(keyframe(2), {&keyframe(1)});
  }

  MapKeyframe& AddKeyframe(double angle_deg) {
    frames_.push_back(world_.Render(frames_.size() + 1, TexturedWorld::OrbitPose(angle_deg)));
    const Frame& frame = *frames_.back();
    return map_.AddKeyframe(MakeFrameFeatures(frame, FeatureExtractor(config_).ExtractScene(frame)),
                            *frame.T_world_camera);
  }
  MapKeyframe& keyframe(uint64_t id) { return *map_.FindKeyframe(KeyframeId{id}); }

  // Median distance between the rays of each point's first two observations, in pixels at the second keyframe. The
  // poses are exact, so it measures the error of the observed pixels.
  double MedianEpipolarError_px() {
    std::vector<double> errors_px;
    for (const auto& [id, track] : map_.points()) {
      if (track.observations.size() < 2) continue;
      const ObservedRay a = map_.RayOf(keyframe(track.observations[0].keyframe.value), track.observations[0].feature);
      const ObservedRay b = map_.RayOf(keyframe(track.observations[1].keyframe.value), track.observations[1].feature);
      const Eigen::Vector3d normal = a.bearing_world.cross(b.center_world - a.center_world).normalized();
      errors_px.push_back(std::abs(normal.dot(b.bearing_world)) * world_.camera().fx_px);
    }
    return Median(std::move(errors_px));
  }

  const SlamConfig config_;
  TexturedWorld world_;
  std::vector<std::shared_ptr<Frame>> frames_;
  SlamMap map_{config_};
  ObservationRefiner refiner_{config_};
};

TEST_F(ObservationRefinerTest, ObservationsBecomeMorePrecise) {
  refiner_.Refine(*frames_[0], keyframe(1), map_);
  ASSERT_GT(map_.points().size(), 60U);
  const double before_px = MedianEpipolarError_px();
  refiner_.Refine(*frames_[1], keyframe(2), map_);
  EXPECT_GT(refiner_.counts().aligned, 40);
  EXPECT_LT(MedianEpipolarError_px(), 0.6 * before_px);
}

TEST_F(ObservationRefinerTest, FindsVisiblePointsThatWereNotMatched) {
  refiner_.Refine(*frames_[0], keyframe(1), map_);
  refiner_.Search(*frames_[0], keyframe(1), map_);
  refiner_.Refine(*frames_[1], keyframe(2), map_);
  refiner_.Search(*frames_[1], keyframe(2), map_);
  MapKeyframe& third = AddKeyframe(8);
  // Connected by a few matches, as after tracking.
  PointMaker maker(config_, &map_);
  std::vector<MapPointId> points;
  for (const auto& [id, track] : map_.points()) points.push_back(id);
  points.resize(points.size() / 2);
  maker.FindKnownPoints(third, points);
  const auto observed = [&] {
    return std::count_if(third.points.begin(), third.points.end(), [](MapPointId id) { return bool(id); });
  };
  const auto before = observed();
  const size_t detected = third.points.size();
  refiner_.Refine(*frames_[2], third, map_);
  refiner_.Search(*frames_[2], third, map_);
  EXPECT_GT(observed(), before + 15);
  ASSERT_EQ(third.points.size(), third.frame->size());
  for (size_t i = detected; i < third.points.size(); ++i) {
    const Eigen::Vector3d p_camera = third.T_camera_world() * map_.FindPoint(third.points[i])->point.position_world;
    EXPECT_LT((third.camera().Project(p_camera) - third.features()[i].pixel_px.cast<double>()).norm(),
              2 * third.features()[i].octave_scale);
  }
}

TEST_F(ObservationRefinerTest, RemovesObservationsOfOtherTexture) {
  refiner_.Refine(*frames_[0], keyframe(1), map_);
  refiner_.Refine(*frames_[1], keyframe(2), map_);
  // The third keyframe looks at the right place, but at the image of another world.
  MapKeyframe& third = AddKeyframe(2);
  const std::shared_ptr<Frame> other = TexturedWorld(320, 240, /*seed=*/9).Render(3, TexturedWorld::OrbitPose(2));
  PointMaker maker(config_, &map_);
  std::vector<MapPointId> points;
  for (const auto& [id, track] : map_.points()) points.push_back(id);
  maker.FindKnownPoints(third, points);
  const auto observed = [&] {
    return std::count_if(third.points.begin(), third.points.end(), [](MapPointId id) { return bool(id); });
  };
  const auto before = observed();
  ASSERT_GT(before, 20);
  refiner_.Refine(*other, third, map_);
  EXPECT_LT(observed(), before);
}

}  // namespace romap::slam::observation_refiner_test
