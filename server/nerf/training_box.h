#pragma once

#include <Eigen/Core>

#include "common/messages.h"

namespace romap {

// The region in which one object is learned: its cuboid, enlarged. Unit space is the Object frame shifted so that the
// box's lowest corner is 0, and divided by the box's longest side: the box is [0, extent_unit] with a longest side of
// 1, and nothing in training depends on the scale of the map.
struct TrainingBox {
  SE3<World, Object> T_world_object;
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  // map units, after enlargement
  double side_mu = 0;                                      // longest side

  // `enlargement` 0.1 makes every side 10 % longer. Flat boxes get at least a fiftieth of the longest side as margin.
  static TrainingBox Around(const Cuboid& cuboid, double enlargement);

  Eigen::Vector3d ToUnit(const Eigen::Vector3d& p_object) const { return (p_object + half_extents) / side_mu; }
  Eigen::Vector3f ExtentUnit() const { return (2.0 * half_extents / side_mu).cast<float>(); }

  // The box after its space underwent `S_new_old`. Unit space stays what it was.
  TrainingBox Moved(const Sim3<World, World>& S_new_old) const;

  // Whether the cuboid lies inside and still fills a good part of this box, so that training may go on in it. A box
  // that a correction turned may lean a little against the cuboid, which is always upright: that alone is no misfit.
  bool StillFits(const Cuboid& cuboid) const;
};

// INVALID_ARGUMENT when pose or size are not finite, or a half extent is not positive.
absl::Status ValidateCuboid(const Cuboid& cuboid);

}  // namespace romap
