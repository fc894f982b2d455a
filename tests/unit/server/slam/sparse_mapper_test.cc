#include "server/slam/sparse_mapper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "common/statistics.h"
#include "tests/support/sparse_mapper_inspector.h"
#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::sparse_mapper_test {

// A keyframe with a pose given by the client.
TrackedImage Keyframe(std::shared_ptr<const Frame> frame) {
  TrackedImage image;
  image.pose_given = true;
  image.tracked.T_world_camera = *frame->T_world_camera;
  image.tracked.is_keyframe = true;
  image.features = MakeFrameFeatures(*frame, FeatureExtractor(SlamConfig{}).Extract(*frame));
  image.points.resize(image.features->size());
  image.tracked.frame = std::move(frame);
  return image;
}

// A mapper for keyframes with given poses.
class Mapper {
 public:
  explicit Mapper(const SlamConfig& config = {}) : mapper_(config, &slot_, SparseMapper::Background::kNothing) {}
  KeyframeView AddKeyframe(const TrackedImage& image) { return *mapper_.Process(image).view; }
  size_t points() const { return mapper_.points(); }
  size_t keyframes() const { return SparseMapperInspector(mapper_).keyframes_made(); }
  size_t keyframes_kept() const { return SparseMapperInspector(mapper_).map().keyframes().size(); }

 private:
  LocalMapSlot slot_;
  SparseMapper mapper_;
};

// The map as reconstructed from the views alone.
struct KnownPoints {
  std::map<MapPointId, MapPoint> points;
  std::map<MapPointId, std::map<uint16_t, int>> labels;

  void Take(const KeyframeView& view) {
    for (size_t i = 0; i < view.points.size(); ++i) {
      points[view.points[i].id] = view.points[i];
      ++labels[view.points[i].id][view.observations[i].label];
    }
    for (const MapPointId id : view.removed_points) {
      points.erase(id);
      labels.erase(id);
    }
  }

  // Quantile `share` of the distances to the true surface.
  double Error_mu(double share) const {
    std::vector<double> errors_mu;
    for (const auto& [id, point] : points) {
      errors_mu.push_back(TexturedWorld::DistanceToSurface_mu(point.position_world));
    }
    return LowerQuantile(std::move(errors_mu), share);
  }
};

KnownPoints MapOrbit(const TexturedWorld& world, Mapper& mapper, int keyframes, bool with_depth = false) {
  KnownPoints known;
  for (int i = 0; i < keyframes; ++i) {
    auto frame = world.Render(static_cast<uint64_t>(i + 1), TexturedWorld::OrbitPose(6.0 * i));
    if (with_depth) frame->depth_mu = world.RenderDepth(*frame);
    known.Take(mapper.AddKeyframe(Keyframe(frame)));
  }
  return known;
}

// The same six views again and again: after a while, they add no keyframe that the map keeps.
TEST(SparseMapper, RepeatedViewsWithGivenPosesDoNotEnlargeTheMap) {
  const TexturedWorld world;
  Mapper mapper;
  std::vector<size_t> keyframes;
  for (uint64_t i = 0; i < 48; ++i) {
    mapper.AddKeyframe(Keyframe(world.Render(i + 1, TexturedWorld::OrbitPose(6.0 * static_cast<double>(i % 6)))));
    if (i % 12 == 11) keyframes.push_back(mapper.keyframes_kept());
  }
  EXPECT_EQ(mapper.keyframes(), 48u);
  EXPECT_LE(keyframes.back(), keyframes.front() + 6) << "kept after 12 and 48 views";
}

TEST(SparseMapper, PointsLieOnTheTrueSurfaces) {
  const TexturedWorld world;
  Mapper mapper;
  const KnownPoints known = MapOrbit(world, mapper, 10);
  EXPECT_EQ(mapper.keyframes(), 10);
  EXPECT_EQ(mapper.points(), known.points.size());
  EXPECT_GT(known.points.size(), 200);
  // One and five percent of the distance of 1.6 mu. A pixel is 0.006 mu wide there; new points have 12 degrees of
  // parallax, so that their errors in depth are five times larger.
  EXPECT_LT(known.Error_mu(0.5), 0.016);
  EXPECT_LT(known.Error_mu(0.9), 0.08);
}

TEST(SparseMapper, ViewsAreConsistent) {
  const TexturedWorld world;
  Mapper mapper;
  for (int i = 0; i < 6; ++i) {
    const auto frame = world.Render(static_cast<uint64_t>(i + 1), TexturedWorld::OrbitPose(6.0 * i));
    const KeyframeView view = mapper.AddKeyframe(Keyframe(frame));
    EXPECT_EQ(view.id, KeyframeId{static_cast<uint64_t>(i + 1)});
    EXPECT_EQ(view.frame, frame);
    ASSERT_EQ(view.observations.size(), view.points.size());
    std::set<MapPointId> observed;
    for (size_t k = 0; k < view.points.size(); ++k) {
      const MapPoint& point = view.points[k];
      EXPECT_EQ(view.observations[k].point, point.id);
      EXPECT_TRUE(observed.insert(point.id).second) << point.id << " is observed twice";
      EXPECT_GE(point.observations, 2);
      EXPECT_GT(point.max_parallax_rad, 0.034);
      const Eigen::Vector2d pixel_px = world.camera().Project(view.T_world_camera.Inverse() * point.position_world);
      EXPECT_LT((pixel_px - view.observations[k].pixel_px.cast<double>()).norm(), 10);
    }
    for (const MapPointId removed : view.removed_points) EXPECT_FALSE(observed.contains(removed));
  }
}

TEST(SparseMapper, LabelsSeparateThePlateFromTheFloor) {
  const TexturedWorld world;
  Mapper mapper;
  const KnownPoints known = MapOrbit(world, mapper, 8);
  int plate_points = 0;
  int misplaced = 0;
  for (const auto& [id, labels] : known.labels) {
    const auto plate = labels.find(TexturedWorld::kPlateLabel);
    if (plate == labels.end() || 2 * plate->second < known.points.at(id).observations) continue;
    ++plate_points;
    misplaced += std::abs(known.points.at(id).position_world.z() - TexturedWorld::kPlateHeight_mu) > 0.1;
  }
  EXPECT_GT(plate_points, 50);
  EXPECT_LT(misplaced, 0.07 * plate_points);
}

TEST(SparseMapper, MoreKeyframesGiveMoreObservationsAndAccuracy) {
  const TexturedWorld world;
  Mapper short_mapper;
  Mapper long_mapper;
  const KnownPoints few = MapOrbit(world, short_mapper, 3);
  const KnownPoints many = MapOrbit(world, long_mapper, 12);
  EXPECT_LT(many.Error_mu(0.5), few.Error_mu(0.5));
  const auto most = std::max_element(many.points.begin(), many.points.end(), [](const auto& a, const auto& b) {
    return a.second.observations < b.second.observations;
  });
  EXPECT_GE(most->second.observations, 5);
}

TEST(SparseMapper, UnrelatedImagesAddNoLastingPoints) {
  const TexturedWorld world;
  Mapper mapper;
  MapOrbit(world, mapper, 4);
  const size_t before = mapper.points();
  for (int i = 0; i < 6; ++i) {  // different noise in every frame: every match is wrong
    auto frame = world.Render(static_cast<uint64_t>(100 + i), TexturedWorld::OrbitPose(24 + 6.0 * i));
    cv::RNG random(static_cast<uint64_t>(i + 1));
    random.fill(frame->image_bgr, cv::RNG::UNIFORM, 0, 255);
    cv::GaussianBlur(frame->image_bgr, frame->image_bgr, {5, 5}, 0);
    mapper.AddKeyframe(Keyframe(frame));
  }
  EXPECT_LT(mapper.points(), before + 10);
}

TEST(SparseMapper, DepthImagesGivePointsFromTheFirstKeyframe) {
  const TexturedWorld world;
  Mapper one;
  const KnownPoints first = MapOrbit(world, one, 1, true);
  EXPECT_GT(first.points.size(), 200);
  EXPECT_LT(first.Error_mu(0.95), 0.01);
  Mapper five;
  EXPECT_LT(MapOrbit(world, five, 5, true).Error_mu(0.9), 0.02);
}

TEST(SparseMapper, SameKeyframesGiveTheSameMap) {
  const TexturedWorld world;
  Mapper once;
  Mapper again;
  const KnownPoints a = MapOrbit(world, once, 6);
  const KnownPoints b = MapOrbit(world, again, 6);
  ASSERT_EQ(a.points.size(), b.points.size());
  for (auto i = a.points.begin(), j = b.points.begin(); i != a.points.end(); ++i, ++j) {
    EXPECT_EQ(i->first, j->first);
    EXPECT_EQ(i->second.position_world, j->second.position_world);
  }
}

TEST(SparseMapper, ImagesWithoutTextureGiveAnEmptyView) {
  Mapper mapper;
  for (const int side_px : {16, 64, 320}) {
    const TexturedWorld world(side_px, side_px);
    const auto frame = world.Render(1, TexturedWorld::OrbitPose(side_px));
    frame->image_bgr.setTo(0);
    EXPECT_TRUE(mapper.AddKeyframe(Keyframe(frame)).observations.empty());
  }
  EXPECT_EQ(mapper.keyframes(), 3);
  EXPECT_EQ(mapper.points(), 0);
}

TEST(SparseMapper, ContinuesWhenTheImageSizeChanges) {
  const TexturedWorld world(320, 240);
  const TexturedWorld larger(400, 300);
  Mapper mapper;
  KnownPoints known = MapOrbit(world, mapper, 4);
  const KeyframeView view = mapper.AddKeyframe(Keyframe(larger.Render(9, TexturedWorld::OrbitPose(24))));
  known.Take(view);
  EXPECT_GT(view.observations.size(), 50);
  const auto old_points = std::count_if(view.points.begin(), view.points.end(),
                                        [](const MapPoint& point) { return point.observations > 3; });
  EXPECT_GT(old_points, 10);
  EXPECT_LT(known.Error_mu(0.5), 0.02);
}

TEST(SparseMapper, RespectsTheMaximumNumberOfPoints) {
  const TexturedWorld world;
  SlamConfig config;
  config.max_points = 150;
  Mapper mapper{config};
  const KnownPoints known = MapOrbit(world, mapper, 8);
  EXPECT_LE(mapper.points(), 150);
  EXPECT_GT(mapper.points(), 100);
  EXPECT_EQ(known.points.size(), mapper.points());
}

TEST(SparseMapper, ImplausiblePoseDoesNotDamageTheMap) {
  const TexturedWorld world;
  Mapper mapper;
  MapOrbit(world, mapper, 4);
  auto frame = world.Render(9, TexturedWorld::OrbitPose(24));
  frame->T_world_camera = SE3<World, Camera>(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1e9, 1e9, -1e9));
  mapper.AddKeyframe(Keyframe(frame));
  for (const MapPoint& point : mapper.AddKeyframe(Keyframe(world.Render(10, TexturedWorld::OrbitPose(30)))).points) {
    EXPECT_LT(point.position_world.norm(), 10);
  }
}

}  // namespace romap::slam::sparse_mapper_test
