#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "common/messages.h"

namespace romap {

// A node that holds nothing for sure: outside the hull, outside the box, or where the field has no finite answer.
inline constexpr float kEmptyRaw = -1e4f;
// A node of the ring around the box: whatever the field says inside, the surface closes at the box.
inline constexpr float kBeyondBoxRaw = -1e30f;
// How far above the surface level a node is set that is declared solid without the field saying so.
inline constexpr float kSolidMargin = 2.0f;

// Raw field values on a regular grid over the box, with one ring of kBeyondBoxRaw nodes around it so that every surface
// closes and every sampled node has all its neighbours. Node (x, y, z) is raw[Index(x, y, z)], x fastest; nodes 1 to
// nodes_per_side - 2 of each axis span the box from face to face.
struct FieldGrid {
  int nodes_per_side = 0;     // with the ring
  Eigen::Vector3f origin;     // of node (0, 0, 0), Object frame, map units
  Eigen::Vector3f spacing;    // between nodes, map units
  float longest_side_mu = 0;  // of the box
  std::vector<float> raw;

  size_t StrideY() const { return nodes_per_side; }
  size_t StrideZ() const { return StrideY() * nodes_per_side; }
  size_t Index(int x, int y, int z) const { return z * StrideZ() + y * StrideY() + x; }
  // The (x, y, z) of a node, as the inverse of Index().
  Eigen::Vector3f NodeAt(size_t index) const {
    return {static_cast<float>(index % StrideY()), static_cast<float>(index % StrideZ() / StrideY()),
            static_cast<float>(index / StrideZ())};
  }
  Eigen::Vector3f Position(const Eigen::Vector3f& node) const { return origin + node.cwiseProduct(spacing); }
  // Inverse of Position(): node coordinates of a point of the Object frame.
  Eigen::Vector3f ToNode(const Eigen::Vector3f& p_object) const { return (p_object - origin).cwiseQuotient(spacing); }
};

// A grid of `resolution`^3 empty nodes over the box |p| <= half_extents, and the ring.
FieldGrid MakeEmptyGrid(int resolution, const Eigen::Vector3f& half_extents);

// Asks the field at all nodes inside the hull (everywhere when the hull has resolution 0). Values that are not a number
// count as empty. The snapshot must have a field, and a hull of resolution^3 bits.
FieldGrid SampleField(const FieldSnapshot& snapshot, int resolution);

}  // namespace romap
