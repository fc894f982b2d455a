#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "server/mesh/field_grid.h"

namespace romap::mesh {

struct VisibilityLimits {
  std::vector<Eigen::Vector3f> view_centers;  // Object frame, map units; ignored if not finite
  float surface_density_per_mu = 0;           // see SurfaceOptics
  float max_optical_depth = 0;                // a node at a larger optical depth from a view is invisible to it
};

// By node: the optical depth of one step of the smallest node spacing. Nodes above the surface's value are opaque: they
// get twice `max_optical_depth`.
std::vector<float> NodeOpticalDepths(const FieldGrid& grid, float surface_density_per_mu, float max_optical_depth);

// Tests whether nodes or surface points of the grid are visible from the training views: whether the optical depth
// along the straight line to some view is within the limit. Nodes above the surface's value are opaque. Rays are
// sampled at steps of the smallest node spacing, each at the nearest node. The tester copies the values, so that the
// grid may be edited later.
class VisibilityTester {
 public:
  VisibilityTester(const FieldGrid& grid, const VisibilityLimits& limits);

  bool has_views() const { return !views_.empty(); }

  // Whether the node is visible from some view. If so, all nodes on the line to that view are marked as visible too.
  bool IsVisible(size_t node);
  // Whether a surface point (node coordinates, inside the ring) is visible from the front in some view: the cosine
  // between the outward `normal` (Object frame, unit length) and the direction to the view is at least `min_cosine`.
  bool IsSurfaceVisible(const Eigen::Vector3f& point, const Eigen::Vector3f& normal, float min_cosine);

 private:
  // Whether the line from a point to a view is clear. If so, `path_` contains the nodes on it.
  bool IsPathClear(const Eigen::Vector3f& view, const Eigen::Vector3f& point);
  int StepsWithinGrid(const Eigen::Vector3f& point, const Eigen::Vector3f& step, float distance_mu) const;
  size_t NearestNode(const Eigen::Vector3f& shifted) const;

  const Eigen::Vector3i nodes_;
  const size_t stride_y_;
  const size_t stride_z_;
  const Eigen::Vector3f spacing_;
  const float step_mu_;
  const float max_optical_depth_;
  std::vector<Eigen::Vector3f> views_;  // in node coordinates
  std::vector<float> optical_depth_;    // of one step, by node
  std::vector<uint8_t> visible_;        // by node: 1 = known to be visible
  std::vector<uint32_t> path_;          // nodes on the last clear line: the first `path_length_`
  size_t path_length_ = 0;
  size_t last_view_ = 0;  // the last view from which a node or point was visible
};

}  // namespace romap::mesh
