#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "server/hull/evidence_grid.h"
#include "server/objects/silhouette.h"

namespace romap::objects {

// A box in space. The Grid frame has its origin at the center of the box. Its z axis points along up_world when the
// region is created; map corrections may tilt it slightly.
struct HullRegion {
  Eigen::Matrix3d R_world_grid = Eigen::Matrix3d::Identity();
  Eigen::Vector3d center_world = Eigen::Vector3d::Zero();
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  // map units

  Eigen::Vector3d ToGrid(const Eigen::Vector3d& p_world) const {
    return R_world_grid.transpose() * (p_world - center_world);
  }
  Eigen::Vector3d ToWorld(const Eigen::Vector3d& p_grid) const { return center_world + R_world_grid * p_grid; }
};

// The visual hull of an object from the silhouettes of its keyframes, over a regular grid of a region. The pixel under
// the center of a cell is evidence for the object or the background. Another mask at that pixel counts as background,
// unless its object may be in front of the cell. Adding or removing a silhouette costs one pass over the grid.
class SilhouetteHull {
 public:
  // Removes all silhouettes. `cells` per side.
  void Reset(const HullRegion& region, int cells);
  void Add(const Silhouette& silhouette) { Count(silhouette, 1); }
  void Remove(const Silhouette& silhouette) { Count(silhouette, -1); }

  // Moves the region with its space. The counts stay valid if the caller moves all added silhouettes too.
  void Move(const Sim3<World, World>& S_new_old);

  bool empty() const { return evidence_.grid().cells == 0; }
  const HullRegion& region() const { return region_; }
  Eigen::Vector3d CellSize() const { return evidence_.grid().CellSize(); }

  // Box around the cells that the rule keeps, Grid frame; empty if there are none.
  Eigen::AlignedBox3d Bounds(const hull::CarvingRule& rule) const { return evidence_.Bounds(rule); }
  // Centers of the cells that the rule keeps, Grid frame, z slowest.
  std::vector<Eigen::Vector3d> Cells(const hull::CarvingRule& rule) const { return evidence_.Cells(rule); }
  // Whether the rule keeps the cell that contains a point. False outside the region.
  bool Contains(const Eigen::Vector3d& p_grid, const hull::CarvingRule& rule) const {
    return evidence_.Contains(p_grid, rule);
  }

 private:
  void Count(const Silhouette& silhouette, int sign);

  HullRegion region_;
  hull::EvidenceGrid evidence_;
};

}  // namespace romap::objects
