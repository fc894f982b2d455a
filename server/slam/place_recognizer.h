#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "server/slam/geometry/pnp.h"
#include "server/slam/geometry/similarity.h"
#include "server/slam/places/place_index.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// The pose of a frame relative to the part of the map around a keyframe.
struct LocatedFrame {
  KeyframeId keyframe;                                  // shows the same place
  SE3<World, Camera> T_world_camera = {};               // in the world of that part
  std::vector<std::pair<MapPointId, int>> points = {};  // with the feature that observes each
  double median_depth_mu = 0;                           // of the points
};

// The match of a point that a keyframe observes at `feature` with the same point at another place, for the similarity
// from this camera to the one there. `p_place`, `p_camera`: the point in the frame of the camera there, and of this
// one.
SimilarityMatch MatchAtPlace(const MapKeyframe& keyframe, int feature, const Eigen::Vector3d& p_place,
                             const Eigen::Vector3d& p_camera, const SlamConfig& config);

// Whether two poses of the same frame exclude each other: they differ by more than drift inside one place could
// explain, 10 degrees or a fifth of the scene depth.
bool AreRivals(const LocatedFrame& a, const LocatedFrame& b);

// Place recognition: finds keyframes by their descriptors and verifies them geometrically. Repeated texture makes
// different places look alike, so a frame that fits two places is assigned to none of them.
class PlaceRecognizer {
 public:
  PlaceRecognizer(const SlamConfig& config, const SlamMap* map) : config_(config), map_(map), index_(1) {}

  void Add(const MapKeyframe& keyframe) { index_.Add(keyframe.id, keyframe.features()); }
  void Remove(KeyframeId keyframe) { index_.Remove(keyframe); }

  // Finds the pose of a frame without a prior. nullopt: no place fits, or several do.
  std::optional<LocatedFrame> Relocalize(const FrameFeatures& frame) const;

  // Keyframes with descriptors similar to the frame's, best first.
  std::vector<KeyframeId> SimilarKeyframes(const FrameFeatures& frame, int max_results) const;

  // The pose of a frame relative to the points around a keyframe, by descriptors and P3P. `call` seeds the samples.
  std::optional<LocatedFrame> Locate(const FrameFeatures& frame, const MapKeyframe& around, uint64_t call) const;

  // The same with a known approximate pose. The points are searched within 10 px of their projections.
  std::optional<LocatedFrame> LocateNear(const FrameFeatures& frame, const MapKeyframe& around,
                                         const SE3<World, Camera>& T_world_camera) const;

 private:
  std::vector<MapPointId> PointsAround(const MapKeyframe& keyframe, size_t neighbors) const;

  const SlamConfig config_;
  const SlamMap* const map_;
  PlaceIndex index_;
};

}  // namespace romap::slam
