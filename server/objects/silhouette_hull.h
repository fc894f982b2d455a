#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "server/objects/silhouette.h"

namespace romap::objects {

// An upright box of space. The Grid frame has its origin in the middle and z along up_world, from which corrections of
// the map may tilt it a little.
struct HullRegion {
  Eigen::Matrix3d R_world_grid = Eigen::Matrix3d::Identity();
  Eigen::Vector3d center_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  // map units

  Eigen::Vector3d ToGrid(const Eigen::Vector3d& p_world) const {
    return R_world_grid.transpose() * (p_world - center_world);
  }
  Eigen::Vector3d ToWorld(const Eigen::Vector3d& p_grid) const { return center_world + R_world_grid * p_grid; }
};

// How many silhouettes must agree that a cell is part of the object.
struct HullVotes {
  int max_outside = 0;
  int min_inside = 1;
};

// The space that the silhouettes of an object leave for it, as votes over a regular grid of a region. Silhouettes are
// added and removed one at a time, each costs one pass over the grid.
// Source: A. Laurentini, "The visual hull concept for silhouette-based image understanding", PAMI 1994.
class SilhouetteHull {
 public:
  // Forgets all votes. `cells` per side.
  void Reset(const HullRegion& region, int cells);
  void Add(const Silhouette& silhouette) { Vote(silhouette, 1); }
  void Remove(const Silhouette& silhouette) { Vote(silhouette, -1); }

  // The region goes along with its space, and so must all silhouettes that voted: then every vote stays right.
  void Move(const Sim3<World, World>& S_new_old);

  bool empty() const { return cells_ == 0; }
  const HullRegion& region() const { return region_; }
  Eigen::Vector3d CellSize() const { return 2.0 / cells_ * region_.half_extents; }

  // Box around the cells that pass, Grid frame; empty when none does.
  Eigen::AlignedBox3d Bounds(const HullVotes& votes) const;
  // Centres of the cells that pass, Grid frame, z slowest.
  std::vector<Eigen::Vector3d> Cells(const HullVotes& votes) const;
  // Whether the cell under a point passes. False outside the region.
  bool Contains(const Eigen::Vector3d& p_grid, const HullVotes& votes) const;

 private:
  void Vote(const Silhouette& silhouette, int weight);
  bool Passes(size_t index, const HullVotes& votes) const {
    return outside_[index] <= votes.max_outside && inside_[index] >= votes.min_inside;
  }
  Eigen::Vector3d CellCenter(int x, int y, int z) const {
    return (2.0 * (Eigen::Vector3d(x, y, z).array() + 0.5) / cells_ - 1) * region_.half_extents.array();
  }

  HullRegion region_;
  int cells_ = 0;
  std::vector<int16_t> inside_;
  std::vector<int16_t> outside_;
};

}  // namespace romap::objects
