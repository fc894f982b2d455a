#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "common/cuboid.h"
#include "server/nerf/math/types.h"

namespace romap::nerf {

// The volume in which one object is trained: its enlarged cuboid. Unit space is the Object frame, shifted so that the
// lowest corner of the box is 0, and divided by the longest side of the object's first box. The first box is therefore
// [0, extent_unit] with a longest side of 1, and training does not depend on the scale of the map.
//
// When the cuboid grows, shrinks or turns, a new box replaces the old one (Refitted). The hash grid, with its unit of
// length, stays where the first box put it, so every box stores its pose in that grid.
struct TrainingBox {
  SE3<World, Object> T_world_object;
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();      // map units, after enlargement
  double unit_mu = 0;                                          // longest side of the first box
  Eigen::Matrix3d R_grid_box = Eigen::Matrix3d::Identity();    // the axes of the grid are those of the first box
  Eigen::Vector3d corner_grid_unit = Eigen::Vector3d::Zero();  // lowest corner of this box in the grid

  // The first box of an object. An `enlargement` of 0.1 makes every side 10 % longer. The margin is at least 1 % of the
  // longest side, for flat cuboids.
  static TrainingBox Around(const Cuboid& cuboid, double enlargement);

  // A box around another cuboid of the same object, in the same hash grid.
  TrainingBox Refitted(const Cuboid& cuboid, double enlargement) const;

  Eigen::Vector3d ToUnit(const Eigen::Vector3d& p_object) const { return (p_object + half_extents) / unit_mu; }
  Eigen::Vector3f ExtentUnit() const { return (2.0 * half_extents / unit_mu).cast<float>(); }
  double LongestSide_mu() const { return 2.0 * half_extents.maxCoeff(); }
  nerf::GridPose GridPose() const;

  // The box after the space around it moved by `S_new_old`. Unit space does not change.
  TrainingBox Moved(const Sim3<World, World>& S_new_old) const;

  // Whether the cuboid is inside this box and fills enough of it that no new box is needed. A correction may have
  // tilted the box slightly against the cuboid, which is always upright; that tilt is ignored.
  bool StillFits(const Cuboid& cuboid) const;

  // Maps points in `other` to points in this box, both in shares of the box's sides: 0..1 inside.
  Eigen::Affine3d ShareOf(const TrainingBox& other) const;
  // The share of the volume of `other` that is inside this box, 0..1, from 512 sample points.
  double ShareCovered(const TrainingBox& other) const;
};

// INVALID_ARGUMENT if the pose is not finite, or a half extent is not finite and positive.
absl::Status ValidateCuboid(const Cuboid& cuboid);

}  // namespace romap::nerf
