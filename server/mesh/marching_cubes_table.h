#pragma once

#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>

namespace romap::mesh {

// Numbering of a grid cell. Corner c lies at (c & 1, c >> 1 & 1, c >> 2 & 1). Edge e runs along axis e / 4 from corner
// EdgeCorner(e) to the corner with that axis's bit set.
inline constexpr int kCellCorners = 8;
inline constexpr int kCellEdges = 12;
inline constexpr int EdgeAxis(int edge) { return edge / 4; }
// Lower corner of an edge: the two bits of edge % 4 go to the two axes other than its own, in ascending order.
inline constexpr int EdgeCorner(int edge) {
  const int low_bit = edge & 1;
  const int high_bit = edge >> 1 & 1;
  switch (EdgeAxis(edge)) {
    case 0:
      return low_bit << 1 | high_bit << 2;
    case 1:
      return low_bit | high_bit << 2;
    default:
      return low_bit | high_bit << 1;
  }
}

// Enough for every pattern: a single loop crosses at most seven cell edges.
inline constexpr size_t kMaxCellTriangles = 5;

// The triangles of one cell, each given by three cell edges, counter-clockwise viewed from outside. Fixed size, so that
// the whole table is one block of 4 KB.
class CellTriangles {
 public:
  using Triangle = std::array<uint8_t, 3>;

  // At most kMaxCellTriangles.
  void Add(const Triangle& triangle) {
    assert(count_ < kMaxCellTriangles);
    triangles_[count_++] = triangle;
  }
  size_t size() const { return count_; }
  const Triangle& operator[](size_t i) const { return triangles_[i]; }
  const Triangle* begin() const { return triangles_.data(); }
  const Triangle* end() const { return triangles_.data() + count_; }

 private:
  uint8_t count_ = 0;
  std::array<Triangle, kMaxCellTriangles> triangles_;
};

// Triangles of a cell for each of the 256 patterns of inside corners (bit c = corner c is inside).
using MarchingCubesTable = std::array<CellTriangles, 256>;

// Built on first use (the method is by Lorensen and Cline, 1987). On each face of the cell the border of each run of
// inside corners is a segment between two cell edges; the segments form closed loops, which are triangulated. If inside
// and outside corners of a face alternate, the inside corners are separated. This rule depends on the face alone, so
// that neighboring cells agree, and no diagonal lies in a face, so that neighboring cells never share one. The surface
// of any grid is therefore a closed 2-manifold.
const MarchingCubesTable& GetMarchingCubesTable();

}  // namespace romap::mesh
