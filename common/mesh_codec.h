#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "common/mesh.h"

namespace romap {

// Meshes as bytes of a Draco 2.2 stream with edgebreaker connectivity, the format of the viewer's DRACOLoader.
// Coordinates are quantized: the error per axis is at most the longest side of the mesh / 2^(position_bits + 1); with
// 14 bits 0.01 mm for a 30 cm object. Colors and the orientation of triangles are kept; texture coordinates are
// quantized like positions, and confidence to 1/255 (a generic attribute with one unsigned byte). The order of vertices
// and triangles changes, and vertices without a triangle are dropped.
struct DracoOptions {
  int position_bits = 14;  // per axis, 1..30
  int normal_bits = 8;     // per octahedral coordinate, 2..30; 8 bits are within 0.7 degrees
  int uv_bits = 13;  // per texture coordinate, 2..30; 13 bits are within an eighth of a texel of a 1024 px texture
  int speed = 5;     // 0 = smallest, 10 = fastest
};

// Largest mesh that is encoded or decoded, so that a damaged size cannot exhaust memory.
inline constexpr size_t kMaxCodecTriangles = size_t{1} << 21;

// INVALID_ARGUMENT: a vertex index out of range, a coordinate that is not finite, normals, colors or confidence that
// are neither absent nor one per vertex, no triangle with three different vertices, more than kMaxCodecTriangles
// triangles, options out of range. Triangles that use a vertex twice are dropped.
absl::StatusOr<std::string> EncodeDraco(const Mesh& mesh, const DracoOptions& options = {});

// INVALID_ARGUMENT: not a stream in the form that EncodeDraco() writes.
absl::StatusOr<Mesh> DecodeDraco(const std::string& bytes);

}  // namespace romap
