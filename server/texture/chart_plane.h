#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace romap::texture {

// Orthographic projection onto a plane, viewed against its normal: x right, y down, as in an image. Triangles that are
// counter-clockwise viewed from outside of the mesh are counter-clockwise in the image, so their signed area is
// negative in these coordinates.
class PlaneProjection {
 public:
  // `normal` has unit length.
  explicit PlaneProjection(const Eigen::Vector3f& normal);

  Eigen::Vector2f operator()(const Eigen::Vector3f& p_object) const { return axes_ * p_object; }  // map units

 private:
  Eigen::Matrix<float, 2, 3> axes_;
};

// The projected triangles of one chart. They never overlap; triangles that touch each other do not count as
// overlapping.
class ChartPlane {
 public:
  using Triangle = std::array<Eigen::Vector2d, 3>;

  // `cell_mu` > 0 is about the length of an edge: triangles are found by a grid with cells of this size.
  ChartPlane(const Eigen::Vector3f& normal, float cell_mu);

  // Adds a triangle (counter-clockwise viewed from outside, map units), unless its projection is reversed or overlaps
  // that of another one.
  bool TryAdd(const std::array<Eigen::Vector3f, 3>& triangle);
  // Removes the last triangles until only `count` are left.
  void ShrinkTo(size_t count);
  size_t Count() const { return triangles_.size(); }

 private:
  // Calls visit(cell) for the cells that a triangle touches, until it returns false.
  template <class Visit>
  void ForEachCell(const Triangle& triangle, const Visit& visit) const;

  PlaneProjection projection_;
  double cell_mu_;
  std::vector<Triangle> triangles_;
  std::unordered_map<uint64_t, std::vector<uint32_t>> in_cell_;  // indices of triangles
};

// Whether the interiors of two triangles have common points. Common parts that are thinner than 1e-5 of the triangles
// do not count, because they come from rounding.
bool TrianglesOverlap(const ChartPlane::Triangle& a, const ChartPlane::Triangle& b);

}  // namespace romap::texture
