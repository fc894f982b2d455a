#include "server/texture/chart_plane.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace romap::texture {
namespace {

constexpr double kThinOverlap = 1e-5;

// Far cells may have the same key, which costs time but is not wrong.
uint64_t CellKey(int64_t x, int64_t y) { return (static_cast<uint64_t>(x) << 32) | static_cast<uint32_t>(y); }

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Whether a line along an edge of `a` separates the triangles.
bool IsSeparatedByEdge(const ChartPlane::Triangle& a, const ChartPlane::Triangle& b) {
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector2d edge = a[(i + 1) % 3] - a[i];
    const double inner = Cross(edge, a[(i + 2) % 3] - a[i]);  // its sign is the side of `a`
    const double side = inner < 0 ? -1 : 1;
    double deepest = -std::numeric_limits<double>::infinity();
    for (const Eigen::Vector2d& p : b) deepest = std::max(deepest, side * Cross(edge, p - a[i]));
    if (deepest <= kThinOverlap * std::abs(inner)) return true;
  }
  return false;
}

}  // namespace

PlaneProjection::PlaneProjection(const Eigen::Vector3f& normal) {
  const Eigen::Vector3f right = normal.unitOrthogonal();
  axes_.row(0) = right.transpose();
  axes_.row(1) = right.cross(normal).transpose();  // down
}

bool TrianglesOverlap(const ChartPlane::Triangle& a, const ChartPlane::Triangle& b) {
  return !IsSeparatedByEdge(a, b) && !IsSeparatedByEdge(b, a);
}

ChartPlane::ChartPlane(const Eigen::Vector3f& normal, float cell_mu) : projection_(normal), cell_mu_(cell_mu) {}

template <class Visit>
void ChartPlane::ForEachCell(const Triangle& triangle, const Visit& visit) const {
  const Triangle p = {triangle[0] / cell_mu_, triangle[1] / cell_mu_, triangle[2] / cell_mu_};
  const auto first_row = static_cast<int64_t>(std::floor(std::min({p[0].y(), p[1].y(), p[2].y()})));
  const auto last_row = static_cast<int64_t>(std::floor(std::max({p[0].y(), p[1].y(), p[2].y()})));
  for (int64_t row = first_row; row <= last_row; ++row) {
    // The columns of the parts of the edges within the row. A long thin triangle touches few cells of its bounding box.
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector2d &from = p[i], along = p[(i + 1) % 3] - from;
      double enter = 0, leave = 1;
      if (along.y() != 0) {
        const double top = static_cast<double>(row) - from.y();
        const double a = top / along.y(), b = (top + 1) / along.y();
        enter = std::max(enter, std::min(a, b));
        leave = std::min(leave, std::max(a, b));
      } else if (from.y() < static_cast<double>(row) || from.y() > static_cast<double>(row + 1)) {
        continue;
      }
      if (enter > leave) continue;
      for (const double at : {enter, leave}) {
        low = std::min(low, from.x() + at * along.x());
        high = std::max(high, from.x() + at * along.x());
      }
    }
    if (low > high) continue;
    for (auto x = static_cast<int64_t>(std::floor(low)); x <= static_cast<int64_t>(std::floor(high)); ++x) {
      if (!visit(CellKey(x, row))) return;
    }
  }
}

bool ChartPlane::TryAdd(const std::array<Eigen::Vector3f, 3>& triangle) {
  Triangle projected;
  for (int i = 0; i < 3; ++i) projected[i] = projection_(triangle[i]).cast<double>();
  const double area_mu2 = Cross(projected[1] - projected[0], projected[2] - projected[0]) / 2;
  if (!(area_mu2 < 0)) return false;
  bool is_free = true;
  ForEachCell(projected, [&](uint64_t cell) {
    const auto others = in_cell_.find(cell);
    if (others == in_cell_.end()) return true;
    for (const uint32_t other : others->second) is_free = is_free && !TrianglesOverlap(projected, triangles_[other]);
    return is_free;
  });
  if (!is_free) return false;
  const auto index = static_cast<uint32_t>(triangles_.size());
  triangles_.push_back(projected);
  ForEachCell(projected, [&](uint64_t cell) {
    in_cell_[cell].push_back(index);
    return true;
  });
  return true;
}

void ChartPlane::ShrinkTo(size_t count) {
  while (triangles_.size() > count) {
    ForEachCell(triangles_.back(), [&](uint64_t cell) {
      in_cell_[cell].pop_back();
      return true;
    });
    triangles_.pop_back();
  }
}

}  // namespace romap::texture
