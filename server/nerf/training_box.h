#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "common/cuboid.h"
#include "server/nerf/math/types.h"

namespace romap::nerf {

// The region in which one object is learned: its cuboid, enlarged. Unit space is the Object frame shifted so that the
// box's lowest corner is 0, and divided by the longest side that the object's first box had: the first box is
// [0, extent_unit] with a longest side of 1, and nothing in training depends on the scale of the map.
//
// When the cuboid grows, shrinks or turns, another box takes over (Refitted). What is learned is stored in a hash grid
// that stays where the first box put it, with its unit of length, hence a box also knows where it lies in that grid.
struct TrainingBox {
  SE3<World, Object> T_world_object;
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();      // map units, after enlargement
  double unit_mu = 0;                                          // longest side of the first box
  Eigen::Matrix3d R_grid_box = Eigen::Matrix3d::Identity();    // the grid's axes are those of the first box
  Eigen::Vector3d corner_grid_unit = Eigen::Vector3d::Zero();  // this box's lowest corner in the grid

  // A first box. `enlargement` 0.1 makes every side 10 % longer. Flat boxes get at least a fiftieth of the longest side
  // as margin.
  static TrainingBox Around(const Cuboid& cuboid, double enlargement);

  // The box around another cuboid of the same object, over the same grid.
  TrainingBox Refitted(const Cuboid& cuboid, double enlargement) const;

  Eigen::Vector3d ToUnit(const Eigen::Vector3d& p_object) const { return (p_object + half_extents) / unit_mu; }
  Eigen::Vector3f ExtentUnit() const { return (2.0 * half_extents / unit_mu).cast<float>(); }
  double LongestSide_mu() const { return 2.0 * half_extents.maxCoeff(); }
  nerf::GridPose GridPose() const;

  // The box after its space underwent `S_new_old`. Unit space stays what it was.
  TrainingBox Moved(const Sim3<World, World>& S_new_old) const;

  // Whether the cuboid lies inside and still fills a good part of this box, so that training may go on in it. A box
  // that a correction turned may lean a little against the cuboid, which is always upright: that alone is no misfit.
  bool StillFits(const Cuboid& cuboid) const;

  // Takes places in `other` to places in this box, both as shares of the box's sides: 0..1 inside.
  Eigen::Affine3d ShareOf(const TrainingBox& other) const;
  // The part of `other` that lies in this box, 0..1, to about one part in five hundred.
  double ShareCovered(const TrainingBox& other) const;
};

// INVALID_ARGUMENT when pose or size are not finite, or a half extent is not positive.
absl::Status ValidateCuboid(const Cuboid& cuboid);

}  // namespace romap::nerf
