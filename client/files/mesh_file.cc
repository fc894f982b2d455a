#include "client/files/mesh_file.h"

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "client/files/obj.h"
#include "client/files/ply.h"
#include "common/file_status.h"

namespace romap::files {
namespace {

std::string LowerExtension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace

absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path) {
  const std::string extension = LowerExtension(path);
  if (extension == ".ply") return ReadPly(path);
  if (extension != ".obj") return InvalidArgument("{}: unknown mesh format; expected a .ply or .obj file", path);
  ROMAP_ASSIGN_OR_RETURN(Mesh mesh, ReadObj(path));
  return MeshFile{std::move(mesh), {}};
}

absl::StatusOr<std::map<std::string, MeshFile>> ReadMeshFolder(const std::string& dir) {
  std::error_code error;
  std::filesystem::directory_iterator entries(dir, error);
  if (error) return FileError(dir, "read", error);
  std::map<std::string, MeshFile> meshes;
  for (const std::filesystem::directory_entry& entry : entries) {
    const std::string extension = LowerExtension(entry.path());
    if (extension != ".ply" && extension != ".obj") continue;
    const std::string name = entry.path().stem().string();
    if (meshes.contains(name)) return InvalidArgument("{}: two meshes are named {}", dir, name);
    ROMAP_ASSIGN_OR_RETURN(meshes[name], ReadMeshFile(entry.path().string()));
  }
  if (meshes.empty()) return NotFound("{}: no .ply or .obj files in this folder", dir);
  return meshes;
}

absl::Status ValidateMesh(const Mesh& mesh, const std::string& name) {
  if (mesh.vertices.empty()) return InvalidArgument("{}: no vertices", name);
  const auto broken = std::count_if(mesh.vertices.begin(), mesh.vertices.end(),
                                    [](const Eigen::Vector3f& vertex) { return !vertex.allFinite(); });
  if (broken > 0) return InvalidArgument("{}: {} vertices are not finite", name, broken);
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t index : triangle) {
      if (index < mesh.vertices.size()) continue;
      return InvalidArgument("{}: vertex index {} in a face is out of range 0..{}", name, index,
                             mesh.vertices.size() - 1);
    }
  }
  return absl::OkStatus();
}

void AppendFan(const std::vector<uint32_t>& polygon, std::vector<std::array<uint32_t, 3>>* triangles) {
  for (size_t k = 1; k + 1 < polygon.size(); ++k) triangles->push_back({polygon[0], polygon[k], polygon[k + 1]});
}

}  // namespace romap::files
