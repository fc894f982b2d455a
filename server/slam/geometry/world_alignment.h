#pragma once

#include <optional>
#include <span>

#include "common/geometry.h"

namespace romap::slam {

// A camera whose pose is known in two worlds.
struct TwoWorldPose {
  SE3<World, Camera> T_map_camera;    // in the map
  SE3<World, Camera> T_given_camera;  // in the client's world
};

// The similarity between a map and the client's world, and how well the poses determine it.
struct WorldAlignment {
  Sim3<World, World> S_given_map;
  double agreeing_share = 0;      // of the pairs: within three standard deviations of the fit
  double position_sigma_mu = 0;   // per axis, of the agreeing pairs, in the client's units
  double rotation_sigma_rad = 0;  // per axis, of the agreeing pairs
  double max_position_mu = 0;     // largest errors of all pairs
  double max_rotation_rad = 0;
  double extent_mu = 0;            // rms distance of the given cameras from their center
  double scale_sigma_ratio = 0;    // standard deviation of the scale over the scale; 0 if the scale is fixed
  double alignment_sigma_rad = 0;  // standard deviation of the rotation
};

// Robust alignment: the rotation is the median of the rotations that single pairs give, so that the cameras may be on a
// line; scale and translation are medians too. Up to half of the pairs may be wrong. `fix_scale`: both worlds are in
// meters. nullopt: fewer than `kMinTwoWorldPoses` pairs, or the cameras do not move in both worlds.
inline constexpr size_t kMinTwoWorldPoses = 3;
std::optional<WorldAlignment> AlignWorlds(std::span<const TwoWorldPose> pairs, bool fix_scale);

}  // namespace romap::slam
