#include "server/objects/support_height.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "common/statistics.h"

namespace romap::objects {
namespace {

// All lengths are in terms of the object's size.
constexpr double kMaxAboveCenter = 0.1;  // of a support, if the object has few points
constexpr double kMaxBelowHull = 0.3;
constexpr double kLayer = 0.05;        // thickness of the layer of points of a surface
constexpr double kMaxDistance = 1.3;   // horizontal, of such a point from the center
constexpr double kMaxMaskError = 0.1;  // of the height that masks reach down to; masks are often a little too large
constexpr size_t kMinLayerPoints = 6;

// The heights at which the support may be.
struct HeightRange {
  double low = 0;
  double high = 0;

  bool Contains(double height) const { return height >= low && height <= high; }
};

double LowestCell(const CuboidEvidence& evidence) {
  double low = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& cell : evidence.hull_cells) low = std::min(low, cell.z());
  return low;
}

// A surface above the lowest fifth of the object's own points, or above the lower end of its masks, cannot support it.
HeightRange PossibleHeights(const CuboidEvidence& evidence, const std::optional<MaskBase>& mask_base) {
  constexpr double kLowPoints = 0.2;  // quantile
  double ceiling = evidence.center.z() + kMaxAboveCenter * evidence.object_size_mu;
  if (evidence.points.size() >= static_cast<size_t>(evidence.min_points)) {
    std::vector<double> heights;
    for (const Eigen::Vector3d& p : evidence.points) heights.push_back(p.z());
    ceiling = NearestQuantile(std::move(heights), kLowPoints);
  }
  const double floor = std::min(LowestCell(evidence), ceiling) - kMaxBelowHull * evidence.object_size_mu;
  ceiling += kLayer * evidence.object_size_mu;
  if (mask_base) ceiling = std::min(ceiling, mask_base->bound + kMaxMaskError * evidence.object_size_mu);
  return {floor, ceiling};
}

std::optional<double> DensestLayer(std::vector<double> heights, double thickness_mu) {
  std::sort(heights.begin(), heights.end());
  size_t best_count = 0;
  double best_height = 0;
  for (size_t first = 0, last = 0; first < heights.size(); ++first) {
    while (last < heights.size() && heights[last] <= heights[first] + thickness_mu) ++last;
    if (last - first <= best_count) continue;
    best_count = last - first;
    best_height = heights[first + best_count / 2];
  }
  return best_count >= kMinLayerPoints ? std::optional(best_height) : std::nullopt;
}

}  // namespace

std::optional<double> FindSupportHeight(const CuboidEvidence& evidence, const std::optional<MaskBase>& mask_base) {
  if (evidence.hull_cells.empty()) return std::nullopt;
  const HeightRange possible = PossibleHeights(evidence, mask_base);
  // An object below this one occludes the surface around it, and the points of that object are not background.
  std::optional<double> supporting_top;
  for (double top : evidence.supporting_tops) {
    if (possible.Contains(top)) supporting_top = std::max(top, supporting_top.value_or(top));
  }
  if (supporting_top) return supporting_top;

  std::vector<double> heights;
  for (const Eigen::Vector3d& p : evidence.background) {
    if ((p - evidence.center).head<2>().norm() > kMaxDistance * evidence.object_size_mu) continue;
    if (possible.Contains(p.z())) heights.push_back(p.z());
  }
  if (const auto layer = DensestLayer(std::move(heights), kLayer * evidence.object_size_mu)) return layer;

  HeightRange near_base = possible;
  if (mask_base) {
    const double error_mu = kMaxMaskError * evidence.object_size_mu;
    near_base = {mask_base->lowest - error_mu, mask_base->bottom + error_mu};
  }
  std::vector<double> bottoms;
  for (double bottom : evidence.neighbor_bottoms) {
    if (possible.Contains(bottom) && near_base.Contains(bottom)) bottoms.push_back(bottom);
  }
  if (bottoms.empty()) return std::nullopt;
  return NearestQuantile(std::move(bottoms), 0.5);
}

}  // namespace romap::objects
