#pragma once

#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "server/slam/place_recognizer.h"
#include "server/slam/rejected_pairs.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// A loop with less drift than this in the newest keyframe's image needs no correction.
inline constexpr double kNoDrift_px = 4;

// A keyframe and an old keyframe that show the same place.
struct LoopMatch {
  KeyframeId newest;
  KeyframeId old;
  Sim3<Camera, Camera> S_old_newest = {};
  std::vector<std::pair<MapPointId, MapPointId>> same_points = {};  // (point of the new side, point of the old side)
  double drift_px = 0;  // median distance in the newest image between features and projections of the old points

  // Motion of the space around the newest keyframe that closes the loop.
  Sim3<World, World> Correction(const SlamMap& map) const;
};

// Finds loops and verifies them before they change the map. A place that looks alike is not proof: textures repeat. A
// loop with drift is accepted only if
// - no other place and not the current pose explain the newest keyframe nearly as well,
// - the correction is possible as the drift along the path between the keyframes (drift_bound.h), and
// - keyframes before the newest, moved by the same correction, observe the old place too.
// Not thread-safe.
class LoopDetector {
 public:
  LoopDetector(const SlamConfig& config, const SlamMap* map, const PlaceRecognizer* places)
      : config_(config), map_(map), places_(places) {}

  // Finds an old keyframe that shows the same place but shares few or no points with this one. `scale_is_known`: the
  // map's scale does not drift.
  std::optional<LoopMatch> Find(const MapKeyframe& keyframe, bool scale_is_known) const;

  // A loop turned out to be wrong: it is not proposed again.
  void Reject(const LoopMatch& loop) { rejected_.Add(loop.newest, loop.old); }

 private:
  bool IsVerified(const MapKeyframe& keyframe, const LocatedFrame& located, const LoopMatch& loop,
                  const std::vector<LocatedFrame>& places, bool scale_is_known) const;
  bool IsExplainedByCurrentPose(const MapKeyframe& keyframe, const LocatedFrame& located) const;
  int CountSupportingKeyframes(const MapKeyframe& keyframe, const LoopMatch& loop) const;
  std::optional<LoopMatch> MakeLoop(const MapKeyframe& keyframe, const LocatedFrame& located,
                                    bool scale_is_known) const;

  const SlamConfig config_;
  const SlamMap* const map_;
  const PlaceRecognizer* const places_;
  RejectedPairs rejected_;
};

}  // namespace romap::slam
