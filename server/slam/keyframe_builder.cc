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

}  // namespace

MapKeyframe& KeyframeBuilder::Add(const TrackedImage& image, const SE3<World, Camera>& T_world_camera,
                                  KeyframeId previous, bool use_prior, SlamMap& map) {
  MapKeyframe& keyframe = Insert(image, T_world_camera, use_prior, map);
  FindPoints(keyframe, map);
  const auto neighbors = map.Covisible(keyframe, 1);
  keyframe.parent = neighbors.empty() ? previous : neighbors.front().first;
  MakePoints(keyframe, map);
  for (const MapPointId id : keyframe.points) {
    if (id) map.Refresh(*map.FindPoint(id));
  }
  return keyframe;
}

MapKeyframe& KeyframeBuilder::Insert(const TrackedImage& image, const SE3<World, Camera>& T_world_camera,
                                     bool use_prior, SlamMap& map) {
  std::shared_ptr<const FrameFeatures> features = image.features;
  const Frame& frame = *image.tracked.frame;
  if (!image.pose_given) {
    // Objects are small, so keyframes get additional features on them.
    const std::vector<Feature> object_features = extractor_.ExtractObjects(frame, UncorrectedFeatures(*features));
    if (!object_features.empty()) {
      std::vector<Feature> all = UncorrectedFeatures(*features);
      all.insert(all.end(), object_features.begin(), object_features.end());
      features = MakeFrameFeatures(frame, std::move(all));
    }
  }
  MapKeyframe& keyframe = map.AddKeyframe(std::move(features), T_world_camera);
  keyframe.scene_features = image.features->size();
  keyframe.pose_given = image.pose_given;
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
