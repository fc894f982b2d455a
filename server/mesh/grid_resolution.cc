#include "server/mesh/grid_resolution.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "common/statistics.h"

namespace romap::mesh {
namespace {

// Quantile of the views by resolution that counts as well resolved: the few sharpest views show only parts of the
// object, and the farthest ones add no detail.
constexpr double kGoodViewShare = 0.75;

// Length in pixels of the longest side of the box in a well-resolved view, as if parallel to the image; 0 without
// views.
double LongestSide_px(const FieldSnapshot& snapshot) {
  std::vector<double> sides_px;
  for (const TrainingCamera& view : snapshot.cameras) {
    const double distance_mu = view.T_camera_object.translation().norm();
    const double side_px = 2.0 * snapshot.box_half_extents.maxCoeff() * view.camera.fx_px / distance_mu;
    if (std::isfinite(side_px) && side_px > 0) sides_px.push_back(side_px);
  }
  if (sides_px.empty()) return 0;
  return LowerQuantile(std::move(sides_px), kGoodViewShare);
}

}  // namespace

Eigen::Vector3i ChooseNodes(const FieldSnapshot& snapshot, const MeshConfig& config) {
  double longest = config.resolution;
  if (config.adapt_resolution) {
    const double side_px = LongestSide_px(snapshot);
    const double limit = snapshot.converged ? 2.0 * longest : longest;
    if (side_px > 0) longest = std::clamp(side_px / config.pixels_per_node, 0.5 * longest, limit);
  }
  const int max_nodes = std::max(2, static_cast<int>(std::lround(longest)));
  const int min_nodes = std::clamp(config.min_side_nodes, 2, max_nodes);
  const Eigen::Vector3d share = (snapshot.box_half_extents / snapshot.box_half_extents.maxCoeff()).cast<double>();
  Eigen::Vector3i nodes;
  for (int axis = 0; axis < 3; ++axis) {
    nodes[axis] = std::clamp(1 + static_cast<int>(std::lround(share[axis] * (max_nodes - 1))), min_nodes, max_nodes);
  }
  return nodes;
}

}  // namespace romap::mesh
