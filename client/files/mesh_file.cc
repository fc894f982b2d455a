#include "client/files/mesh_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <limits>

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

// The origin of one coordinate; see MeshFile::origin.
double OriginOf(const std::vector<double>& values) {
  const auto is_exact = [](double value) { return !std::isfinite(value) || value == static_cast<float>(value); };
  if (std::all_of(values.begin(), values.end(), is_exact)) return 0;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  return low + (high - low) / 2;
}

}  // namespace

absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path) {
  const std::string extension = LowerExtension(path);
  if (extension == ".ply") return ReadPly(path);
  if (extension != ".obj") return InvalidArgument("{}: unknown mesh format; expected a .ply or .obj file", path);
  return ReadObj(path);
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

void SetPositions(const std::array<std::vector<double>, 3>& columns, MeshFile* file) {
  file->mesh.vertices.resize(columns[0].size());
  for (int axis = 0; axis < 3; ++axis) {
    file->origin[axis] = OriginOf(columns[axis]);
    for (size_t k = 0; k < columns[axis].size(); ++k) {
      file->mesh.vertices[k][axis] = static_cast<float>(columns[axis][k] - file->origin[axis]);
    }
  }
}

void AppendFan(const std::vector<uint32_t>& polygon, std::vector<std::array<uint32_t, 3>>* triangles) {
  for (size_t k = 1; k + 1 < polygon.size(); ++k) triangles->push_back({polygon[0], polygon[k], polygon[k + 1]});
}

}  // namespace romap::files
