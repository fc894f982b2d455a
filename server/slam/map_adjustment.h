#pragma once

#include <atomic>
#include <vector>

#include "server/slam/optimize/bundle_adjustment.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// A part of the map as a bundle problem, with the keyframe and point ids of its entries. A copy, so that another thread
// can solve it while the map changes.
struct MapProblem {
  BundleProblem bundle;
  std::vector<KeyframeId> keyframes;       // of bundle.cameras
  std::vector<MapPointId> points;          // of bundle.points
  std::vector<SE3<World, Camera>> before;  // poses of bundle.cameras when the problem was made
  KeyframeId newest_keyframe;              // of the map when the problem was made
  MapPointId newest_point;                 // the same
};

// The newest keyframe, those that share most points with it, and all their points; other keyframes that observe these
// points are fixed and anchor the window.
MapProblem WindowProblem(const SlamMap& map, const MapKeyframe& newest, const SlamConfig& config);

// All keyframes and points. The first keyframe is fixed unless it has a prior. Without depth, the observations do not
// determine the scale; the damping of the solver keeps it. `find_lens`: the lens correction is estimated too.
MapProblem GlobalProblem(const SlamMap& map, const SlamConfig& config, bool find_lens);

// Writes the solution of a window back and removes the outlier observations. Keyframes and points that are newer than
// the problem move with their parents and with their first keyframes; the others outside the window stay.
void ApplyWindow(const MapProblem& problem, SlamMap& map);

// Writes back a solution that was found while the map changed: newer keyframes move with their parents, and newer
// points with their first keyframe.
void ApplyGlobal(const MapProblem& problem, SlamMap& map);

}  // namespace romap::slam
