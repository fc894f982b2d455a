#include "server/slam/keyframe_builder.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "server/slam/covisibility.h"
#include "server/slam/point_maker.h"

namespace romap::slam {
namespace {

constexpr int kFewPoints = 100;  // with fewer known points in a keyframe, tracking may fail soon

constexpr size_t kFirstKeyframes = 2;
constexpr float kFixedRadius_px = 12;  // around features that are fixed to the camera: of the same object

void RefreshPoints(const MapKeyframe& keyframe, SlamMap& map) {
  for (const MapPointId id : keyframe.points) {
    if (id) map.Refresh(*map.FindPoint(id));
  }
}

}  // namespace

MapKeyframe& KeyframeBuilder::Insert(const TrackedImage& image, const SE3<World, Camera>& T_world_camera,
                                     KeyframeId previous, bool use_prior, SlamMap& map) const {
  MapKeyframe& keyframe = map.AddKeyframe(image.features, T_world_camera);
  keyframe.scene_features = image.features->size();
  keyframe.pose_given = image.pose_given;
  keyframe.parent = previous;
  const Frame& frame = *image.tracked.frame;
  if (!image.pose_given && frame.T_world_camera && use_prior) {
    keyframe.prior = PosePrior{.T_world_camera = *frame.T_world_camera,
                               .rotation_sigma_rad = config_.prior_sigma_rad,
                               .translation_sigma_mu = config_.prior_sigma_mu};
  }
  for (size_t i = 0; i < image.points.size(); ++i) {
    if (!image.points[i]) continue;
    if (PointTrack* track = map.FindPoint(image.points[i])) map.AddObservation(*track, keyframe, static_cast<int>(i));
  }
  return keyframe;
}

void KeyframeBuilder::MakeFirstPoints(MapKeyframe& keyframe, SlamMap& map) const {
  PointMaker maker(config_, &map);
  std::vector<MapKeyframe*> newest;
  for (auto it = map.keyframes().rbegin(); it != map.keyframes().rend() && newest.size() < kFirstKeyframes; ++it) {
    if (it->first != keyframe.id) newest.push_back(&it->second);
  }
  maker.MakePointsByParallax(keyframe, newest);
  maker.MakePointsByDepth(keyframe);
  RefreshPoints(keyframe, map);
}

void KeyframeBuilder::Complete(const TrackedImage& image, MapKeyframe& keyframe, SlamMap& map) {
  if (!keyframe.pose_given) AddObjectFeatures(image, keyframe);
  FindPoints(keyframe, map);
  const auto neighbors = map.Covisible(keyframe, 1);
  if (!neighbors.empty()) keyframe.parent = neighbors.front().first;
  MakePoints(keyframe, map);
  RefreshPoints(keyframe, map);
}

// Objects are small, so keyframes get additional features on them.
void KeyframeBuilder::AddObjectFeatures(const TrackedImage& image, MapKeyframe& keyframe) {
  const Frame& frame = *image.tracked.frame;
  std::vector<Feature> features = UncorrectedFeatures(*keyframe.frame);
  std::vector<Feature> object_features = extractor_.ExtractObjects(frame, features);
  std::erase_if(object_features, [&](const Feature& feature) {
    return std::any_of(image.fixed_px.begin(), image.fixed_px.end(), [&](const Eigen::Vector2f& fixed_px) {
      return (fixed_px - feature.pixel_px).norm() < kFixedRadius_px;
    });
  });
  if (object_features.empty()) return;
  features.insert(features.end(), object_features.begin(), object_features.end());
  keyframe.frame = MakeFrameFeatures(frame, std::move(features), keyframe.frame->lens, keyframe.frame->shutter);
  keyframe.points.resize(keyframe.frame->size());
}

void KeyframeBuilder::FindPoints(MapKeyframe& keyframe, SlamMap& map) const {
  std::vector<MapPointId> candidates;
  if (keyframe.pose_given) {
    for (const auto& [id, track] : map.points()) candidates.push_back(id);
  } else {
    candidates = PointsOf(map, Neighborhood(map, keyframe, 20, 5));
  }
  PointMaker(config_, &map).FindKnownPoints(keyframe, candidates);
}

void KeyframeBuilder::MakePoints(MapKeyframe& keyframe, SlamMap& map) const {
  const auto known =
      std::count_if(keyframe.points.begin(), keyframe.points.end(), [](MapPointId id) { return bool(id); });
  const bool has_few = !keyframe.pose_given && known < kFewPoints;
  PointMaker by_parallax(has_few ? PointMaker::RelaxedConfig(config_) : config_, &map);
  by_parallax.MakePointsByParallax(keyframe, by_parallax.KeyframesToMatch(keyframe));
  PointMaker maker(config_, &map);
  maker.MakePointsByDepth(keyframe);
  if (keyframe.pose_given) return;
  std::vector<MapKeyframe*> neighbors;
  for (const KeyframeId id : Neighborhood(map, keyframe, 8, 0)) neighbors.push_back(map.FindKeyframe(id));
  maker.FuseDuplicates(keyframe, neighbors);
}

}  // namespace romap::slam
