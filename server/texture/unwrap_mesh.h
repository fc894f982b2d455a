#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <vector>

#include "common/mesh.h"

namespace romap::texture {

// A mesh with texture coordinates (Mesh::uv) and the size of its texture. Vertices on the borders of charts occur once
// per chart, at the same position. The center of texel (x, y) is at ((x + 0.5) / atlas_px, (y + 0.5) / atlas_px).
struct TexturedMesh {
  Mesh mesh;         // Object frame
  int atlas_px = 0;  // width and height of the texture
};

struct UnwrapOptions {
  int max_atlas_px = 1024;  // 64..8192; rounded down to a multiple of 32
  // The resolution of a surface that is parallel to its chart. Texels per map unit; 0: as high as the largest atlas
  // allows. If charts do not fit into the largest atlas, the resolution is lower.
  float texels_per_mu = 0;
  int padding_px = 2;           // free texels around each chart, 0..16
  float max_angle_rad = 0.95f;  // between the triangles of a chart and its plane, see ChartOptions
};

// Divides the surface into charts, projects each onto its plane and packs them into a square atlas. Triangles do not
// overlap in the atlas, and all charts have the same scale. The side of the atlas is a multiple of 32 texels. An empty
// mesh gives an empty one with the smallest atlas. Vertices must be finite and triangles must refer to them.
//
// INVALID_ARGUMENT: an option is outside its range, or the surface is so rough that its charts with their padding do
// not fit into the largest atlas.
absl::StatusOr<TexturedMesh> UnwrapMesh(const Mesh& mesh, const UnwrapOptions& options);

}  // namespace romap::texture
