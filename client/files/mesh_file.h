#pragma once

#include <map>
#include <string>
#include <vector>

#include "common/mesh.h"
#include "common/status.h"

namespace romap::files {

// A mesh, or a point cloud (no triangles), with the further numbers its file holds for each vertex.
struct MeshFile {
  Mesh mesh;
  std::map<std::string, std::vector<double>> scalars;  // by property name, each as long as mesh.vertices
};

// Reads a .ply or .obj file. NOT_FOUND or INVALID_ARGUMENT naming the file and its fault: cut off, garbled, no
// vertices, vertices that are not finite, triangles with vertices that do not exist, neither .ply nor .obj.
absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path);

// All .ply and .obj files of a folder by name without extension. As ReadMeshFile; also NOT_FOUND when there are
// none and INVALID_ARGUMENT when two have the same name.
absl::StatusOr<std::map<std::string, MeshFile>> ReadMeshFolder(const std::string& dir);

// INVALID_ARGUMENT unless there are vertices, all finite, and every triangle's vertices exist. `name` goes into the
// message.
absl::Status ValidateMesh(const Mesh& mesh, const std::string& name);

// Adds the triangles of a convex polygon as a fan around its first corner.
void AppendFan(const std::vector<uint32_t>& polygon, std::vector<std::array<uint32_t, 3>>* triangles);

}  // namespace romap::files
