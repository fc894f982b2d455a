#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "common/mesh.h"
#include "common/status.h"

namespace romap::files {

// A mesh or a point cloud (no triangles), with additional values per vertex.
struct MeshFile {
  // The position of vertex k in the frame of the file.
  Eigen::Vector3d Position(size_t k) const { return mesh.vertices[k].cast<double>() + origin; }

  Mesh mesh;
  // Of the vertices, in the frame of the file. Zero along an axis if single precision stores all coordinates of the
  // file exactly; otherwise the center of the bounding box, so that meshes far from the origin keep their shape.
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  std::map<std::string, std::vector<double>> scalars;  // by property name, each as long as mesh.vertices
};

// Reads a .ply or .obj file. INVALID_ARGUMENT: another extension; truncated or malformed; no vertices; a vertex that is
// not finite; a triangle with a vertex index out of range. Otherwise as ReadFile.
absl::StatusOr<MeshFile> ReadMeshFile(const std::string& path);

// Reads all .ply and .obj files of a folder. Keys are file names without extension. Errors as ReadMeshFile, and
// NOT_FOUND if there are none or INVALID_ARGUMENT if two have the same name.
absl::StatusOr<std::map<std::string, MeshFile>> ReadMeshFolder(const std::string& dir);

// Sets the vertices and their origin from the x, y and z coordinates of a file. The columns have the same length.
void SetPositions(const std::array<std::vector<double>, 3>& columns, MeshFile* file);

// Triangulates a convex polygon as a fan around its first vertex.
void AppendFan(const std::vector<uint32_t>& polygon, std::vector<std::array<uint32_t, 3>>* triangles);

}  // namespace romap::files
