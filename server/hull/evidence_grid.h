#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/hull/voxel_grid.h"

namespace romap::hull {

// Evidence of one view for a cell.
enum class CellEvidence : uint8_t {
  kObject,      // the object's mask covers the cell
  kBackground,  // the cell is empty
  kOccluded,    // the view contains the cell, but something may hide it
  kCropped,     // the image contains the cell, but the crop with the object's mask does not
  kNone,        // the image does not contain the cell; not counted
};

// Rule that decides which cells a hull keeps. A cell is removed in two cases:
// - It is empty: at least max(min_background, background_share * n) views show background, where n is the number of
//   views whose crop contains the cell.
// - It is unconfirmed: fewer than max(min_object, object_share * n) views show the object, where n is the number of
//   views whose image contains the cell. Views in which something hides the cell are no evidence that it is empty;
//   without this rule, space that other objects hide in nearly all views would be kept.
struct CarvingRule {
  int min_background = 1;
  double background_share = 0;
  int min_object = 0;
  double object_share = 0;
};

// The visual hull of an object: counts the views by kind of evidence for each cell of a grid. The counts allow rules
// that tolerate some wrong masks, and they allow a view to be removed. At most 255 views. Source: A. Laurentini, "The
// visual hull concept for silhouette-based image understanding", PAMI 1994.
class EvidenceGrid {
 public:
  // Removes all views.
  void Reset(const VoxelGrid& grid);
  // Scales the grid after its space and all views were scaled.
  void Scale(double factor) { grid_.half_extents *= factor; }

  const VoxelGrid& grid() const { return grid_; }

  // Adds (sign 1) or removes (sign -1) the evidence of one view for consecutive cells.
  void Count(size_t first_cell, std::span<const CellEvidence> evidence, int sign);
  // Adds or removes evidence that is the same for all of these cells.
  void Count(size_t first_cell, size_t cells, CellEvidence evidence, int sign);

  // Number of views with this evidence for a cell; not for kNone.
  int Views(size_t cell, CellEvidence evidence) const { return views_[static_cast<size_t>(evidence)][cell]; }
  bool Keeps(size_t cell, const CarvingRule& rule) const;

  // Returns 1 for each cell that the rule keeps, otherwise 0.
  std::vector<uint8_t> Carve(const CarvingRule& rule) const;
  // Centers of the cells that the rule keeps, z slowest.
  std::vector<Eigen::Vector3d> Cells(const CarvingRule& rule) const;
  // Box around the cells that the rule keeps; empty if there are none.
  Eigen::AlignedBox3d Bounds(const CarvingRule& rule) const;
  // Whether the rule keeps the cell that contains a point; false outside the grid.
  bool Contains(const Eigen::Vector3d& p_grid, const CarvingRule& rule) const;

 private:
  template <class Visit>
  void ForEachKept(const CarvingRule& rule, Visit visit) const;

  VoxelGrid grid_;
  std::array<std::vector<uint8_t>, 4> views_;  // by CellEvidence and cell
};

}  // namespace romap::hull
