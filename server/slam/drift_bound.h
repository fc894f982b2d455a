#pragma once

#include "server/slam/slam_map.h"

namespace romap::slam {

// A bound of the error of one keyframe's pose relative to another: three standard deviations of the drift of visual
// odometry along the path between them.
struct DriftBound {
  double rotation_rad = 0;
  double translation_mu = 0;
  double log_scale = 0;  // 0 if the scale is known
  double path_mu = 0;    // length of the path
  double turn_rad = 0;   // sum of the rotation angles along the path
  int path_keyframes = 0;
};

// The path is the one in the tree of MapKeyframe::parent. Errors of consecutive relative poses have a random part,
// which grows with the square root of their number, and a systematic part (calibration, texture on one side), which
// grows with the length of the path and the angle turned. A rotation error also displaces the end of the path.
// `scale_is_known`: from depth images or the client's poses.
DriftBound DriftBetween(const SlamMap& map, KeyframeId from, KeyframeId to, bool scale_is_known);

// Whether the motion `S_new_old` of the space around `keyframe` is possible as the correction of this drift.
bool IsWithin(const DriftBound& bound, const Sim3<World, World>& S_new_old, const MapKeyframe& keyframe);

}  // namespace romap::slam
