#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace romap::mesh {

// Value of a node that is certainly empty: outside the hull, outside the box, or where the field is not finite.
inline constexpr float kEmpty = -1e4f;
// Value of the ring of nodes around the box, so that the surface closes at the box for any field.
inline constexpr float kBeyondBox = -1e30f;
// Value of a node that a rule made solid regardless of the field.
inline constexpr float kSolid = 2.0f;

// The field on a regular grid over the box, with one ring of kBeyondBox nodes around it so that every surface closes
// and every other node has all its neighbors. A value is the logarithm of the density over that at the surface: 0 on
// the surface, > 0 inside. Node (x, y, z) is value[Index(x, y, z)], x fastest; nodes 1 to nodes - 2 of each axis span
// the box from face to face.
struct FieldGrid {
  Eigen::Vector3i nodes = Eigen::Vector3i::Zero();  // per axis, with the ring
  Eigen::Vector3f origin;                           // of node (0, 0, 0), Object frame, map units
  Eigen::Vector3f spacing;                          // between nodes, map units
  std::vector<float> value;
  std::vector<uint8_t> edited;  // 1 = a rule replaced the field's value

  size_t StrideY() const { return static_cast<size_t>(nodes.x()); }
  size_t StrideZ() const { return StrideY() * static_cast<size_t>(nodes.y()); }
  size_t Index(int x, int y, int z) const {
    return static_cast<size_t>(z) * StrideZ() + static_cast<size_t>(y) * StrideY() + static_cast<size_t>(x);
  }
  // The (x, y, z) of a node; the inverse of Index().
  Eigen::Vector3f NodeAt(size_t index) const {
    // 32-bit division takes half as long as 64-bit division.
    const auto node = static_cast<uint32_t>(index);
    const auto stride_y = static_cast<uint32_t>(StrideY());
    const auto row = node / stride_y, rows = static_cast<uint32_t>(nodes.y());
    return {static_cast<float>(node - row * stride_y), static_cast<float>(row % rows), static_cast<float>(row / rows)};
  }
  Eigen::Vector3f Position(const Eigen::Vector3f& node) const { return origin + node.cwiseProduct(spacing); }
  // Node coordinates of a point in the Object frame; the inverse of Position().
  Eigen::Vector3f ToNode(const Eigen::Vector3f& p_object) const { return (p_object - origin).cwiseQuotient(spacing); }

  void Edit(size_t index, float new_value) {
    value[index] = new_value;
    edited[index] = 1;
  }
};

// A grid of `box_nodes` (each >= 2) empty nodes over the box |p| <= half_extents, and the ring.
FieldGrid MakeEmptyGrid(const Eigen::Vector3i& box_nodes, const Eigen::Vector3f& half_extents);

}  // namespace romap::mesh
