#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace romap {

// Numbering of a grid cell. Corner c lies at (c & 1, c >> 1 & 1, c >> 2 & 1). Edge e runs along axis e / 4 from corner
// EdgeCorner(e) to the corner with that axis' bit set.
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

// Triangles of a cell for each of the 256 patterns of inside corners (bit c = corner c is inside). Each triangle names
// three cell edges, counter-clockwise seen from outside.
using MarchingCubesTable = std::array<std::vector<std::array<uint8_t, 3>>, 256>;

// Built once, from first principles (Lorensen & Cline 1987 give the idea). On each face of the cell the border of each
// run of inside corners is a segment between two cell edges; the segments link to closed loops, which are cut into
// triangles. Where inside and outside corners of a face alternate, the inside corners are kept apart. That depends on
// the face alone, so neighbouring cells agree, and no cut runs along a face, so that two neighbours never cut the same:
// the surface over any grid is a closed 2-manifold.
const MarchingCubesTable& GetMarchingCubesTable();

}  // namespace romap
