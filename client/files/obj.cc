#include "client/files/obj.h"

#include <tiny_obj_loader.h>

#include <optional>
#include <sstream>

#include "client/files/mesh_file.h"
#include "client/files/text_file.h"

namespace romap::files {
namespace {

// tinyobjloader reads missing and malformed coordinates as 0, so they are checked before.
absl::Status CheckVertexLines(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<TableLine> lines, ReadTable(path));
  for (const TableLine& line : lines) {
    if (line.fields[0] != "v") continue;
    bool valid = line.fields.size() >= 4;
    for (size_t k = 1; valid && k < 4; ++k) valid = ParseNumber(line.fields[k]).has_value();
    if (!valid) return InvalidArgument("{}:{}: expected 'v x y z' with finite numbers", path, line.number);
  }
  return absl::OkStatus();
}

struct ObjContents {
  Mesh mesh;
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
    const std::optional<uint32_t> index = ToIndex(corners[k].vertex_index, contents.mesh.vertices.size());
    if (index) polygon.push_back(*index);
  }
  if (count >= 3 && polygon.size() == static_cast<size_t>(count)) {
    AppendFan(polygon, &contents.mesh.triangles);
  } else if (!contents.bad_face) {
    contents.bad_face = contents.faces;
  }
}

void AddVertex(void* user_data, float x, float y, float z, float /*w*/) {
  static_cast<ObjContents*>(user_data)->mesh.vertices.emplace_back(x, y, z);
}

}  // namespace

absl::StatusOr<Mesh> ReadObj(const std::string& path) {
  ROMAP_RETURN_IF_ERROR(CheckVertexLines(path));
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
  ROMAP_RETURN_IF_ERROR(ValidateMesh(contents.mesh, path));
  return std::move(contents.mesh);
}

}  // namespace romap::files
