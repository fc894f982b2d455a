#include "server/session/mesh_encoding.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "common/mesh_codec.h"
#include "common/status.h"
#include "server/mesh/extract_mesh.h"
#include "server/mesh/filtered_normals.h"
#include "server/mesh/next_view.h"
#include "server/texture/align_surface.h"
#include "server/texture/simplify_mesh.h"
#include "server/texture/texture_mesh.h"

namespace romap::session {
namespace {

// More views cost more time, but hardly improve a texture.
constexpr size_t kMaxTextureViews = 24;

std::vector<TrainingCamera> TextureViewsOf(const FieldSnapshot& snapshot) {
  std::vector<TrainingCamera> views;
  const size_t all = snapshot.cameras.size();
  const size_t count = std::min(kMaxTextureViews, all);
  for (size_t k = 0; k < count; ++k) {
    const TrainingCamera& view = snapshot.cameras[k * all / count];
    if (texture::ValidateTextureView(view).ok()) views.push_back(view);
  }
  return views;
}

// Moves the surface to where the images agree.
void AlignWithImages(const FieldSnapshot& snapshot, Mesh* mesh) {
  const texture::SurfaceAlignment alignment = texture::AlignSurface(TextureViewsOf(snapshot), *mesh);
  if (alignment.moved_share > 0) mesh::SetFilteredNormals(*mesh);
  spdlog::debug("{}: {:.0f} % of the surface moved by {:.5f} on average", snapshot.object.ToString(),
                100 * alignment.moved_share, alignment.mean_mu);
}

// Replaces the mesh by a simpler one with a texture.
absl::Status AddTexture(const FieldSnapshot& snapshot, const mesh::MeshConfig& config, Mesh* mesh,
                        MeshTexture* texture) {
  const std::vector<TrainingCamera> views = TextureViewsOf(snapshot);
  if (views.empty()) return FailedPrecondition("no view shows the object");
  texture::TextureOptions options;
  options.max_triangles = static_cast<size_t>(config.texture_triangles);
  options.max_atlas_px = config.texture_px;
  ROMAP_ASSIGN_OR_RETURN(texture::TexturedObject textured, texture::TextureMesh(*mesh, views, options));
  *mesh = std::move(textured.textured.mesh);
  *texture = std::move(textured.texture);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<MeshUpdate> MakeMeshUpdate(const FieldSnapshot& snapshot, const mesh::MeshConfig& config) {
  ROMAP_ASSIGN_OR_RETURN(Mesh mesh, mesh::ExtractMesh(snapshot, config));
  MeshUpdate update;
  update.id = snapshot.object;
  update.steps = snapshot.steps;
  update.train_seconds = snapshot.train_seconds;
  update.final = snapshot.converged;
  update.next_view = mesh::FindNextView(mesh);  // first, because simplification leaves vertices unevenly spread
  if (snapshot.converged) AlignWithImages(snapshot, &mesh);
  if (snapshot.converged && config.texture) {
    const absl::Status status = AddTexture(snapshot, config, &mesh, &update.texture);
    if (!status.ok()) {
      spdlog::info("{}: the final mesh has no texture: {}", snapshot.object.ToString(), Message(status));
    }
  }
  update.vertex_count = static_cast<uint32_t>(mesh.vertices.size());
  update.triangle_count = static_cast<uint32_t>(mesh.triangles.size());
  ROMAP_ASSIGN_OR_RETURN(update.draco, EncodeDraco(mesh, DracoOptions{}));
  if (snapshot.converged) {
    for (const texture::Simplified& level : texture::MakeLevels(mesh)) {
      ROMAP_ASSIGN_OR_RETURN(std::string draco, EncodeDraco(level.mesh, DracoOptions{}));
      update.levels.push_back({std::move(draco), static_cast<uint32_t>(level.mesh.triangles.size()), level.error_mu});
    }
  }
  return update;
}

}  // namespace romap::session
