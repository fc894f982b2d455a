#include <algorithm>
#include <bit>
#include <cmath>

#include "client/files/ply.h"
#include "client/files/text_file.h"
#include "common/mesh_faces.h"

namespace romap::files {
namespace {

static_assert(std::endian::native == std::endian::little, "values are written in native byte order");

template <class T>
void Append(const T& value, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&value), sizeof(T));
}

bool FitsBytes(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(),
                     [](double value) { return value >= 0 && value <= 255 && value == std::floor(value); });
}

// A scalar property per vertex.
struct Column {
  const std::vector<double>* values;
  bool as_bytes;  // uchar, otherwise float
};

using Scalars = std::map<std::string, std::vector<double>>;

std::string WriteHeader(const Mesh& mesh, const Scalars& scalars, const char* coordinate_type) {
  std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {0}\n"
      "property {1} x\nproperty {1} y\nproperty {1} z\n",
      mesh.vertices.size(), coordinate_type);
  if (!mesh.normals.empty()) header += "property float nx\nproperty float ny\nproperty float nz\n";
  if (!mesh.colors.empty()) header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (!mesh.confidence.empty()) header += "property float confidence\n";
  for (const auto& [name, values] : scalars) {
    header += fmt::format("property {} {}\n", FitsBytes(values) ? "uchar" : "float", name);
  }
  if (!mesh.triangles.empty()) {
    header += fmt::format("element face {}\nproperty list uchar int vertex_indices\n", mesh.triangles.size());
  }
  return header + "end_header\n";
}

// `S_world_mesh` is null if the vertices are written unchanged.
absl::Status WriteAnyPly(const std::string& path, const Mesh& mesh, const Scalars& scalars,
                         const Sim3<World, Object>* S_world_mesh) {
  ROMAP_RETURN_IF_ERROR(ValidateMesh(mesh, path));
  const size_t count = mesh.vertices.size();
  const auto fits = [count](size_t size) { return size == 0 || size == count; };
  std::vector<Column> columns;
  for (const auto& [name, values] : scalars) {
    if (values.size() != count)
      return InvalidArgument("{}: {} values of '{}' for {} vertices", path, values.size(), name, count);
    columns.push_back({&values, FitsBytes(values)});
  }
  if (!fits(mesh.normals.size()) || !fits(mesh.colors.size()) || !fits(mesh.confidence.size())) {
    return InvalidArgument("{}: {} normals, {} confidences and {} colors for {} vertices", path, mesh.normals.size(),
                           mesh.confidence.size(), mesh.colors.size(), count);
  }
  if (!mesh.confidence.empty() && scalars.contains("confidence")) {
    return InvalidArgument("{}: 'confidence' is given both by the mesh and by the scalars", path);
  }
  std::string bytes = WriteHeader(mesh, scalars, S_world_mesh != nullptr ? "double" : "float");
  bytes.reserve(bytes.size() + 48 * count + 13 * mesh.triangles.size());
  const Eigen::Matrix3f R_world_mesh = S_world_mesh != nullptr
                                           ? S_world_mesh->rotation().toRotationMatrix().cast<float>().eval()
                                           : Eigen::Matrix3f::Identity().eval();
  for (size_t k = 0; k < count; ++k) {
    if (S_world_mesh != nullptr) {
      const Eigen::Vector3d p_world = *S_world_mesh * mesh.vertices[k].cast<double>();
      Append(p_world, &bytes);
    } else {
      Append(mesh.vertices[k], &bytes);
    }
    if (!mesh.normals.empty()) {
      const Eigen::Vector3f normal = R_world_mesh * mesh.normals[k];
      Append(normal, &bytes);
    }
    if (!mesh.colors.empty()) Append(mesh.colors[k], &bytes);
    if (!mesh.confidence.empty()) Append(mesh.confidence[k], &bytes);
    for (const Column& column : columns) {
      const double value = (*column.values)[k];
      column.as_bytes ? Append(static_cast<uint8_t>(value), &bytes) : Append(static_cast<float>(value), &bytes);
    }
  }
  for (const auto& triangle : mesh.triangles) {
    Append(uint8_t{3}, &bytes);
    Append(triangle, &bytes);
  }
  return WriteFile(path, bytes);
}

}  // namespace

absl::Status WritePly(const std::string& path, const Mesh& mesh,
                      const std::map<std::string, std::vector<double>>& scalars) {
  return WriteAnyPly(path, mesh, scalars, nullptr);
}

absl::Status WriteWorldPly(const std::string& path, const Mesh& mesh, const Sim3<World, Object>& S_world_mesh) {
  return WriteAnyPly(path, mesh, {}, &S_world_mesh);
}

}  // namespace romap::files
