#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/mesh.h"
#include "server/texture/texture_view.h"
#include "server/texture/unwrap_mesh.h"

namespace romap::texture {

struct TextureOptions {
  size_t max_triangles = 8000;
  // Triangles are merged while the surface moves by less than this share of the mesh's diagonal.
  float max_error_share = 0.001f;
  int max_atlas_px = 1024;
  // Resolution of the texture relative to that of the views, before foreshortening. > 0.
  float texels_per_pixel = 1.25f;
  // PNG is exact, but several times larger. JPEG stores color (not brightness) at half of the resolution.
  bool use_png = false;
  int jpeg_quality = 90;  // 1..100
};

struct TextureTimes {
  double simplify_s = 0, unwrap_s = 0, bake_s = 0, encode_s = 0;
};

// A mesh with its texture as a file.
struct TexturedObject {
  TexturedMesh textured;
  MeshTexture texture;    // 8 bits, RGB
  float error_mu = 0;     // Simplified::error_mu
  double seen_share = 0;  // share of the texels of the surface that a view shows
  TextureTimes times;     // wall time
};

// Simplifies a mesh (Object frame), unwraps it and colors its texture from the views. The resolution of the texture is
// that of most views (third quartile at the object's center), if the atlas is large enough. Without views, it is a low
// one, and the texture shows the vertex colors.
//
// INVALID_ARGUMENT: the mesh has no triangles, vertices that are not finite or beyond 1e9, triangles without vertices,
// or attributes of another length than the vertices; a view is not valid (ValidateTextureView); an option is outside
// its range. The message names the element. INTERNAL: the image cannot be encoded.
absl::StatusOr<TexturedObject> TextureMesh(const Mesh& mesh, std::span<const TrainingCamera> views,
                                           const TextureOptions& options);

}  // namespace romap::texture
