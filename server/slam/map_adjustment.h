#pragma once

#include <atomic>
#include <vector>

#include "server/slam/optimize/bundle_adjustment.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// A part of the map as a bundle problem, and which keyframe and point each entry is. A value: it can be solved on
// another thread while the map changes.
struct MapProblem {
  BundleProblem bundle;
  std::vector<KeyframeId> keyframes;       // of bundle.cameras
  std::vector<MapPointId> points;          // of bundle.points
  std::vector<SE3<World, Camera>> before;  // poses of bundle.cameras when the problem was made
};

// The newest keyframe, those that share most points with it, and all their points; keyframes farther away that see
// these points hold the window in place.
MapProblem WindowProblem(const SlamMap& map, const MapKeyframe& newest, const SlamConfig& config);

// All keyframes and points. The first keyframe is fixed unless it has a prior. Without depth the scale is free, and
// damping keeps it. `find_lens`: the lens correction is estimated too.
MapProblem GlobalProblem(const SlamMap& map, const SlamConfig& config, bool find_lens);

// Writes the solution of a window back and drops the outlier observations.
void ApplyWindow(const MapProblem& problem, SlamMap& map);

// Writes back a solution that was found while the map changed: newer keyframes move with their parents, and newer
// points with their first keyframe.
void ApplyGlobal(const MapProblem& problem, SlamMap& map);

}  // namespace romap::slam
