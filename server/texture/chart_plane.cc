#include "server/texture/chart_plane.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace romap::texture {
namespace {

constexpr double kThinOverlap = 1e-5;

uint64_t CellKey(int32_t x, int32_t y) {
  return (static_cast<uint64_t>(static_cast<uint32_t>(x)) << 32) | static_cast<uint32_t>(y);
}

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

ChartPlane::Cells ChartPlane::CellsOf(const Triangle& triangle) const {
  const Eigen::Vector2d low = triangle[0].cwiseMin(triangle[1]).cwiseMin(triangle[2]) / cell_mu_;
  const Eigen::Vector2d high = triangle[0].cwiseMax(triangle[1]).cwiseMax(triangle[2]) / cell_mu_;
  return {static_cast<int32_t>(std::floor(low.x())), static_cast<int32_t>(std::floor(low.y())),
          static_cast<int32_t>(std::floor(high.x())), static_cast<int32_t>(std::floor(high.y()))};
}

bool ChartPlane::TryAdd(const std::array<Eigen::Vector3f, 3>& triangle) {
  Triangle projected;
  for (int i = 0; i < 3; ++i) projected[i] = projection_(triangle[i]).cast<double>();
  const double area_mu2 = Cross(projected[1] - projected[0], projected[2] - projected[0]) / 2;
  if (!(area_mu2 < 0)) return false;
  const Cells cells = CellsOf(projected);
  for (int32_t y = cells.y0; y <= cells.y1; ++y) {
    for (int32_t x = cells.x0; x <= cells.x1; ++x) {
      const auto others = in_cell_.find(CellKey(x, y));
      if (others == in_cell_.end()) continue;
      for (const uint32_t other : others->second) {
        if (TrianglesOverlap(projected, triangles_[other])) return false;
      }
    }
  }
  const auto index = static_cast<uint32_t>(triangles_.size());
  triangles_.push_back(projected);
  for (int32_t y = cells.y0; y <= cells.y1; ++y) {
    for (int32_t x = cells.x0; x <= cells.x1; ++x) in_cell_[CellKey(x, y)].push_back(index);
  }
  return true;
}

void ChartPlane::ShrinkTo(size_t count) {
  while (triangles_.size() > count) {
    const Cells cells = CellsOf(triangles_.back());
    for (int32_t y = cells.y0; y <= cells.y1; ++y) {
      for (int32_t x = cells.x0; x <= cells.x1; ++x) in_cell_[CellKey(x, y)].pop_back();
    }
    triangles_.pop_back();
  }
}

}  // namespace romap::texture
