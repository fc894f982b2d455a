#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "common/mesh.h"

namespace romap {

// Meshes as bytes of a Draco 2.2 stream, edgebreaker connectivity: what the viewer's DRACOLoader reads. Coordinates
// lose precision: each axis is off by at most the longest side of the mesh / 2^(position_bits + 1); 14 bits are 0.01 mm
// of a 30 cm object. Colours and the orientation of triangles are kept; the order of vertices and triangles is not, and
// vertices without a triangle go.
struct DracoOptions {
  int position_bits = 14;  // per axis, 1..30
  int normal_bits = 8;     // per octahedral coordinate, 2..30; 8 bits are within 0.7 degrees
  int speed = 5;           // 0 = smallest, 10 = fastest
};

// Largest mesh that either way takes, so that a broken length cannot ask for all memory.
inline constexpr size_t kMaxCodecTriangles = size_t{1} << 21;

// INVALID_ARGUMENT: an index beyond the vertices, a coordinate that is not finite, normals or colours neither absent
// nor one per vertex, no triangle with three different vertices, more than kMaxCodecTriangles, options out of range.
// Triangles that name a vertex twice are left out.
absl::StatusOr<std::string> EncodeDraco(const Mesh& mesh, const DracoOptions& options = {});

// INVALID_ARGUMENT: not a stream as EncodeDraco writes it.
absl::StatusOr<Mesh> DecodeDraco(const std::string& bytes);

}  // namespace romap
