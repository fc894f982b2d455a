#include "client/eval/shape_eval.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "common/angles.h"

namespace romap::eval {
namespace {

constexpr double kHollow_m = 0.01;
constexpr double kMaxNormalDistance_m = 0.01;

}  // namespace

ShapeFigures MeasureShape(const OrientedPoints& truth, const OrientedPoints& predicted) {
  const Neighbors nearest = NearestIndex(truth.points).Query(predicted.points);
  const size_t count = predicted.points.size();
  ShapeFigures figures;
  figures.accuracy_closed_cm =
      100 * std::accumulate(nearest.distance.begin(), nearest.distance.end(), 0.0) / static_cast<double>(count);
  if (truth.normals.empty()) return figures;
  size_t hollow = 0, compared = 0;
  double angles_deg = 0;
  for (size_t k = 0; k < count; ++k) {
    const uint32_t index = nearest.index[k];
    const Eigen::Vector3d& normal = truth.normals[index];
    const bool is_inside = normal.dot(predicted.points[k] - truth.points[index]) < 0;
    if (is_inside && nearest.distance[k] > kHollow_m) ++hollow;
    if (predicted.normals.empty() || nearest.distance[k] > kMaxNormalDistance_m) continue;
    ++compared;
    angles_deg += std::acos(std::clamp(normal.dot(predicted.normals[k]), -1.0, 1.0)) * kDegPerRad;
  }
  figures.hollow_percent = 100 * static_cast<double>(hollow) / static_cast<double>(count);
  if (compared > 0) figures.normal_error_deg = angles_deg / static_cast<double>(compared);
  return figures;
}

}  // namespace romap::eval
