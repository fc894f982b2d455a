#include "client/files/obj_write.h"

#include <fmt/format.h>

#include <filesystem>
#include <iterator>

#include "client/files/mesh_file.h"
#include "client/files/text_file.h"
#include "common/mesh_faces.h"

namespace romap::files {
namespace {

absl::StatusOr<std::string> ExtensionOf(const MeshTexture& texture) {
  if (texture.media_type == "image/jpeg") return std::string(".jpg");
  if (texture.media_type == "image/png") return std::string(".png");
  return InvalidArgument("a texture of type '{}' cannot be written: expected image/jpeg or image/png",
                         texture.media_type);
}

absl::Status ValidateAttributes(const Mesh& mesh, const std::string& name) {
  ROMAP_RETURN_IF_ERROR(ValidateMesh(mesh, name));
  for (const size_t count : {mesh.normals.size(), mesh.colors.size(), mesh.uv.size()}) {
    if (count != 0 && count != mesh.vertices.size()) {
      return InvalidArgument("{}: normals, colors and texture coordinates must be absent or {}, not {}", name,
                             mesh.vertices.size(), count);
    }
  }
  return absl::OkStatus();
}

// Nine digits: 1 mm is kept 100 km from the origin.
void AppendVertices(const Mesh& mesh, const Sim3<World, Object>& S_world_mesh, bool with_colors, std::string* text) {
  const auto out = std::back_inserter(*text);
  for (size_t k = 0; k < mesh.vertices.size(); ++k) {
    const Eigen::Vector3d p_world = S_world_mesh * mesh.vertices[k].cast<double>();
    fmt::format_to(out, "v {:.9g} {:.9g} {:.9g}", p_world.x(), p_world.y(), p_world.z());
    if (with_colors) {
      const Rgb8& color = mesh.colors[k];
      fmt::format_to(out, " {:.4f} {:.4f} {:.4f}", color[0] / 255.0, color[1] / 255.0, color[2] / 255.0);
    }
    text->push_back('\n');
  }
}

void AppendFaces(const Mesh& mesh, bool with_uv, std::string* text) {
  const auto out = std::back_inserter(*text);
  for (const auto& triangle : mesh.triangles) {
    text->push_back('f');
    for (const uint32_t index : triangle) {
      const uint32_t number = index + 1;
      fmt::format_to(out, " {}", number);
      if (with_uv) fmt::format_to(out, "/{}", number);
      if (!mesh.normals.empty()) fmt::format_to(out, "{}/{}", with_uv ? "" : "/", number);
    }
    text->push_back('\n');
  }
}

}  // namespace

absl::Status WriteObj(const std::string& path, const Mesh& mesh, const Sim3<World, Object>& S_world_mesh,
                      const MeshTexture& texture) {
  ROMAP_RETURN_IF_ERROR(ValidateAttributes(mesh, path));
  const bool has_texture = !texture.image.empty() && !mesh.uv.empty();
  std::string text = "# map units, World frame\n";
  if (has_texture) {
    const std::filesystem::path stem = std::filesystem::path(path).replace_extension();
    ROMAP_ASSIGN_OR_RETURN(const std::string extension, ExtensionOf(texture));
    const std::string name = stem.filename().string();
    ROMAP_RETURN_IF_ERROR(WriteFile(stem.string() + extension, texture.image));
    ROMAP_RETURN_IF_ERROR(
        WriteFile(stem.string() + ".mtl", fmt::format("newmtl surface\nKd 1 1 1\nmap_Kd {}{}\n", name, extension)));
    text += fmt::format("mtllib {}.mtl\n", name);
  }
  AppendVertices(mesh, S_world_mesh, /*with_colors=*/!has_texture && !mesh.colors.empty(), &text);
  const auto out = std::back_inserter(text);
  if (has_texture) {
    // OBJ counts v upwards.
    for (const Eigen::Vector2f& uv : mesh.uv) fmt::format_to(out, "vt {:.6f} {:.6f}\n", uv.x(), 1 - uv.y());
  }
  for (const Eigen::Vector3f& normal : mesh.normals) {
    const Eigen::Vector3d n_world = S_world_mesh.rotation() * normal.cast<double>();
    fmt::format_to(out, "vn {:.4f} {:.4f} {:.4f}\n", n_world.x(), n_world.y(), n_world.z());
  }
  if (has_texture) text += "usemtl surface\n";
  AppendFaces(mesh, has_texture, &text);
  return WriteFile(path, text);
}

}  // namespace romap::files
