#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>

#include "common/geometry.h"

namespace romap {

// An upright box: |x|, |y|, |z| <= half_extents in the Object frame.
struct Cuboid {
  SE3<World, Object> T_world_object;                       // z axis is up; the x axis gives the yaw
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  // map units
  double confidence = 0;                                   // 0..1
};

// The corners of a cuboid in the world, with its half extents multiplied by `enlargement`. Corner i has +half_extents
// along x, y, z of the Object frame where bit 0, 1, 2 of i is set, and -half_extents elsewhere.
inline std::array<Eigen::Vector3d, 8> CuboidCorners(const Cuboid& cuboid, double enlargement = 1) {
  std::array<Eigen::Vector3d, 8> corners;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector3d signs((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1);
    corners[i] = cuboid.T_world_object * (enlargement * signs.cwiseProduct(cuboid.half_extents));
  }
  return corners;
}

}  // namespace romap
