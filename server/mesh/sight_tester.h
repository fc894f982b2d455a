#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/mesh/field_grid.h"

namespace romap::mesh {

// Where to look from and how far sight reaches.
struct SightLimits {
  std::vector<Eigen::Vector3f> view_centers;  // Object frame, map units; those that are not finite are left out
  float surface_density_per_mu = 0;           // see SurfaceOptics
  float max_optical_depth = 0;                // beyond it a view sees nothing
};

// Answers whether a place in the grid can be seen from the training views: the optical depth on the straight way to a
// view is within the limit. Nodes above the surface's value block all sight. Rays advance by the smallest node spacing,
// and the node nearest to each step speaks for it. The values are copied: later changes of the grid do not matter.
class SightTester {
 public:
  SightTester(const FieldGrid& grid, const SightLimits& limits);

  bool has_views() const { return !views_.empty(); }

  // Whether some view sees the node. All nodes on the way to that view are seen as well and will be known to be.
  bool IsSeen(size_t node);
  // Whether some view sees a place (node coordinates, within the ring) of a surface with this outward normal (Object
  // frame, unit length) from the front: the cosine between normal and direction to the view is at least `min_cosine`.
  bool IsSurfaceSeen(const Eigen::Vector3f& place, const Eigen::Vector3f& normal, float min_cosine);

 private:
  // Whether the way from a place towards a view is clear. The nodes on it are then in `way_`.
  bool IsWayClear(const Eigen::Vector3f& view, const Eigen::Vector3f& place);
  int StepsWithinGrid(const Eigen::Vector3f& place, const Eigen::Vector3f& step, float way_mu) const;
  size_t NodeNear(const Eigen::Vector3f& shifted) const;

  const Eigen::Vector3i nodes_;
  const size_t stride_y_;
  const size_t stride_z_;
  const Eigen::Vector3f spacing_;
  const float step_mu_;
  const float max_optical_depth_;
  std::vector<Eigen::Vector3f> views_;  // in node coordinates
  std::vector<float> optical_depth_;    // of one step, by node
  std::vector<uint8_t> seen_;           // by node: 1 = some view sees it
  std::vector<uint32_t> way_;           // nodes on the last way that was clear: the first `way_length_`
  size_t way_length_ = 0;
  size_t last_view_ = 0;  // that saw something
};

}  // namespace romap::mesh
