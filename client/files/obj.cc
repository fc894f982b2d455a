#include "client/files/obj.h"

#include <tiny_obj_loader.h>

#include <array>
#include <optional>
#include <sstream>

#include "client/files/text_file.h"
#include "common/mesh_faces.h"

namespace romap::files {
namespace {

// The x, y and z coordinates of all vertices. tinyobjloader rounds them to single precision and reads missing and
// malformed ones as 0.
absl::StatusOr<std::array<std::vector<double>, 3>> ReadVertexLines(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<TableLine> lines, ReadTable(path));
  std::array<std::vector<double>, 3> columns;
  for (const TableLine& line : lines) {
    if (line.fields[0] != "v") continue;
    for (size_t k = 0; k < 3; ++k) {
      const std::optional<double> value =
          k + 1 < line.fields.size() ? ParseNumber(line.fields[k + 1]) : std::optional<double>();
      if (!value) return InvalidArgument("{}:{}: expected 'v x y z' with finite numbers", path, line.number);
      columns[k].push_back(*value);
    }
  }
  return columns;
}

struct ObjContents {
  std::vector<std::array<uint32_t, 3>> triangles;
  size_t vertices = 0;  // so far
  size_t faces = 0;
  std::optional<size_t> bad_face;  // number of the first face with a malformed or nonexistent vertex, from 1
};

// Converts a vertex number of the file (1 = first vertex, -1 = latest vertex so far) to an index.
std::optional<uint32_t> ToIndex(int number, size_t vertex_count) {
  const int64_t index = number > 0 ? number - int64_t{1} : static_cast<int64_t>(vertex_count) + number;
  if (number == 0 || index < 0) return std::nullopt;
  return static_cast<uint32_t>(index);
}

void AddFace(void* user_data, tinyobj::index_t* corners, int count) {
  auto& contents = *static_cast<ObjContents*>(user_data);
  ++contents.faces;
  std::vector<uint32_t> polygon;
  for (int k = 0; k < count; ++k) {
    const std::optional<uint32_t> index = ToIndex(corners[k].vertex_index, contents.vertices);
    if (index) polygon.push_back(*index);
  }
  if (count >= 3 && polygon.size() == static_cast<size_t>(count)) {
    AppendFan(polygon, &contents.triangles);
  } else if (!contents.bad_face) {
    contents.bad_face = contents.faces;
  }
}

void AddVertex(void* user_data, float /*x*/, float /*y*/, float /*z*/, float /*w*/) {
  ++static_cast<ObjContents*>(user_data)->vertices;
}

}  // namespace

absl::StatusOr<MeshFile> ReadObj(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const auto columns, ReadVertexLines(path));
  ROMAP_ASSIGN_OR_RETURN(const std::string text, ReadFile(path));
  std::istringstream stream(text);
  tinyobj::callback_t callbacks;
  callbacks.vertex_cb = AddVertex;
  callbacks.index_cb = AddFace;
  ObjContents contents;
  std::string error;
  if (!tinyobj::LoadObjWithCallback(stream, callbacks, &contents, nullptr, nullptr, &error)) {
    return InvalidArgument("{}: {}", path, error);
  }
  if (contents.bad_face) {
    return InvalidArgument("{}: face {}: expected 'f a b c ...' with vertex numbers from 1", path, *contents.bad_face);
  }
  MeshFile file;
  SetPositions(columns, &file);
  file.mesh.triangles = std::move(contents.triangles);
  ROMAP_RETURN_IF_ERROR(ValidateMesh(file.mesh, path));
  return file;
}

}  // namespace romap::files
