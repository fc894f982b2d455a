#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/features/patch.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// Moves the observations of a new keyframe to the exact positions of their map points: the detector finds corners to
// about half a pixel of their octave, and a descriptor may match a neighboring corner. Each point keeps its patch from
// one reference keyframe; other observations are aligned to it. Observations whose image differs from the patch are
// removed. Stores the images of recent keyframes, because new points are also observed there. Not thread-safe.
class ObservationRefiner {
 public:
  explicit ObservationRefiner(const SlamConfig& config) : mask_erosion_px_(config.mask_erosion_px) {}

  // Reads the patches of points that have none; the keyframe becomes their reference.
  void ReadPatches(const Frame& frame, const MapKeyframe& keyframe, SlamMap& map);
  // Call after the keyframe's points are known and new ones were made.
  void Refine(const Frame& frame, MapKeyframe& keyframe, SlamMap& map);
  // Also observes points that are visible but were not matched, at the positions of their patches. Long tracks reduce
  // the drift more than precise ones. Call after Refine(), at any time. `frame`: of the keyframe.
  void Search(const Frame& frame, MapKeyframe& keyframe, SlamMap& map);

  struct Counts {
    int aligned = 0;
    int not_aligned = 0;  // kept as detected
    int removed = 0;
    int added = 0;
  };
  const Counts& counts() const { return counts_; }

 private:
  struct NewPixel {
    int feature = 0;
    Eigen::Vector2d image_px = Eigen::Vector2d::Zero();
  };

  void Align(const PointTrack& track, const FeatureRef& observation, SlamMap& map);
  void Apply(SlamMap& map);

  int mask_erosion_px_;
  std::map<KeyframeId, HalvedImages> images_;  // of recent keyframes
  std::map<KeyframeId, std::vector<NewPixel>> moved_;
  std::vector<std::pair<MapPointId, KeyframeId>> wrong_;
  Counts counts_;
};

}  // namespace romap::slam
