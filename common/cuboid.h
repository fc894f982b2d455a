#pragma once

#include <Eigen/Core>

#include "common/geometry.h"

namespace romap {

// An upright box: |x|, |y|, |z| <= half_extents in the Object frame.
struct Cuboid {
  SE3<World, Object> T_world_object;                       // z axis is up; the x axis gives the yaw
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  // map units
  double confidence = 0;                                   // 0..1
};

}  // namespace romap
