#include "server/objects/footprint.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

namespace romap::objects {
namespace {

constexpr double kQuarterTurn = std::numbers::pi / 2;

Footprint RectangleAt(double yaw_rad, const std::vector<cv::Point2f>& outline) {
  const Eigen::Rotation2Dd to_rectangle(-yaw_rad);
  Eigen::Vector2d low = Eigen::Vector2d::Constant(1e300);
  Eigen::Vector2d high = -low;
  for (const cv::Point2f& point : outline) {
    const Eigen::Vector2d p = to_rectangle * Eigen::Vector2d(point.x, point.y);
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return {yaw_rad, to_rectangle.inverse() * Eigen::Vector2d((low + high) / 2), (high - low) / 2};
}

std::vector<cv::Point2f> OutlineFromAbove(const std::vector<Eigen::Vector3d>& cells) {
  std::vector<cv::Point2f> points;
  // Only the first and the last cell of a row can be on the outline; a grid lists the cells of a row consecutively.
  for (size_t first = 0, next = 0; first < cells.size(); first = next) {
    Eigen::Vector2d ends(cells[first].x(), cells[first].x());
    for (next = first + 1; next < cells.size() && cells[next].y() == cells[first].y(); ++next) {
      ends = {std::min(ends[0], cells[next].x()), std::max(ends[1], cells[next].x())};
    }
    for (double x : ends) points.emplace_back(static_cast<float>(x), static_cast<float>(cells[first].y()));
  }
  std::vector<cv::Point2f> outline;
  cv::convexHull(points, outline);
  return outline;
}

}  // namespace

std::optional<Footprint> FitFootprint(const std::vector<Eigen::Vector3d>& cells, const Eigen::Vector3d& cell_size,
                                      std::optional<double> previous_yaw_rad, std::optional<double> edge_yaw_rad) {
  constexpr size_t kMinCells = 4;
  if (cells.size() < kMinCells) return std::nullopt;
  const std::vector<cv::Point2f> outline = OutlineFromAbove(cells);

  const double pad = (cell_size.x() + cell_size.y()) / 4;
  const auto area = [&](const Footprint& f) { return (f.half_extents.array() + pad).prod(); };
  const double reference = previous_yaw_rad.value_or(0);
  Footprint best = RectangleAt(reference, outline);
  const double reference_area = area(best);
  double smallest = reference_area;
  double largest = reference_area;
  constexpr int kSteps = 90;  // of a quarter turn: one degree
  for (int step = 1; step < kSteps; ++step) {
    // Within 45 degrees of the reference, which selects the nearest of the four equivalent yaws.
    const double offset = kQuarterTurn * (static_cast<double>(step) / kSteps - 0.5);
    const Footprint candidate = RectangleAt(reference + offset, outline);
    const double candidate_area = area(candidate);
    largest = std::max(largest, candidate_area);
    if (candidate_area >= smallest) continue;
    smallest = candidate_area;
    best = candidate;
  }
  if (edge_yaw_rad) {
    const double offset = std::remainder(*edge_yaw_rad - reference, kQuarterTurn);
    const Footprint along_edges = RectangleAt(reference + offset, outline);
    // Ratio to the smallest area; above it the edges are those of a print or a shadow.
    constexpr double kMaxAreaRatio = 1.35;
    if (area(along_edges) < kMaxAreaRatio * smallest) {
      best = along_edges;
      best.half_extents.array() += pad;
      return best;
    }
  }
  constexpr double kRoundRatio = 0.88;   // of the smallest to the largest area, from which the footprint is round
  constexpr double kNearlyBest = 1.015;  // ratio to the smallest area, within the discretization error of the cells
  const bool keep = smallest > kRoundRatio * largest || (previous_yaw_rad && reference_area < kNearlyBest * smallest);
  if (keep) best = RectangleAt(reference, outline);
  best.half_extents.array() += pad;
  return best;
}

double YawInGrid(const Cuboid& cuboid, const Eigen::Matrix3d& R_world_grid) {
  const Eigen::Vector3d x_grid = R_world_grid.transpose() * cuboid.T_world_object.RotationMatrix().col(0);
  return std::atan2(x_grid.y(), x_grid.x());
}

}  // namespace romap::objects
