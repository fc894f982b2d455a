#pragma once

#include <atomic>
#include <vector>

#include "server/slam/optimize/bundle_adjustment.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

// A part of the map as a bundle problem, and which keyframe and point each entry is. A value: it can be solved on
// another thread while the map goes on.
struct MapProblem {
  BundleProblem bundle;
  std::vector<KeyframeId> keyframes;       // of bundle.cameras
  std::vector<MapPointId> points;          // of bundle.points
  std::vector<SE3<World, Camera>> before;  // poses of bundle.cameras when the problem was made
};

// The newest keyframe, those that share most points with it, and all their points; keyframes farther away that see
// these points hold the window in place.
MapProblem WindowProblem(const SlamMap& map, const MapKeyframe& newest, const SlamConfig& config);

// Everything. The first keyframe stays, unless priors hold the map; without depth the scale is free, and damping keeps
// it where it is. `find_lens`: what is left of the lens is found along with it.
MapProblem GlobalProblem(const SlamMap& map, const SlamConfig& config, bool find_lens);

// Writes the solution of a window back and drops the outlier observations.
void ApplyWindow(const MapProblem& problem, SlamMap& map);

// Writes back a solution that was found while the map went on: keyframes and points that came meanwhile go along with
// the keyframe they hang on.
void ApplyGlobal(const MapProblem& problem, SlamMap& map);

}  // namespace romap::slam
