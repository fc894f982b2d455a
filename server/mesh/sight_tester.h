#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "server/mesh/field_grid.h"

namespace romap {

// Answers whether a place in the grid can be seen from the training views: the optical depth on the straight way to a
// view is at most `max_optical_depth`. Nodes above `level` block all sight; below, the density is exp(raw) per longest
// box side. Rays advance by the smallest node spacing, and the node nearest to each step speaks for it. The values are
// copied: later changes of the grid do not matter.
class SightTester {
 public:
  // View centres in the Object frame, map units; those that are not finite are left out.
  SightTester(const FieldGrid& grid, float level, std::span<const Eigen::Vector3f> view_centers,
              float max_optical_depth);

  bool has_views() const { return !views_.empty(); }

  // Places below are in node coordinates, within the ring.

  bool IsSeen(const Eigen::Vector3f& place);
  // As IsSeen, but only views that look at the surface with this outward normal (Object frame, unit length) from the
  // front count: the cosine between normal and direction to the view is at least `min_cosine`.
  bool IsSurfaceSeen(const Eigen::Vector3f& place, const Eigen::Vector3f& normal, float min_cosine);

 private:
  bool Sees(const Eigen::Vector3f& view, const Eigen::Vector3f& place) const;
  int StepsWithinGrid(const Eigen::Vector3f& place, const Eigen::Vector3f& step, float way_mu) const;

  const int nodes_per_side_;
  const size_t stride_y_;
  const size_t stride_z_;
  const Eigen::Vector3f spacing_;
  const float step_mu_;
  const float max_optical_depth_;
  std::vector<Eigen::Vector3f> views_;  // in node coordinates
  std::vector<float> optical_depth_;    // of one step, by node
  size_t last_view_ = 0;                // that saw something
};

}  // namespace romap
