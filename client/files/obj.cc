#include "client/files/obj.h"

#include <charconv>
#include <optional>

#include "client/files/mesh_file.h"
#include "client/files/text_file.h"

namespace romap::files {
namespace {

std::optional<Eigen::Vector3f> ParseVertex(const std::vector<std::string>& fields) {
  if (fields.size() < 4) return std::nullopt;
  Eigen::Vector3f vertex;
  for (int k = 0; k < 3; ++k) {
    const std::optional<double> value = ParseNumber(fields[k + 1]);
    if (!value) return std::nullopt;
    vertex[k] = static_cast<float>(*value);
  }
  return vertex;
}

// Corners "7", "7/1" or "7//3"; 1 is the first vertex, -1 the last one so far.
std::optional<std::vector<uint32_t>> ParseFace(const std::vector<std::string>& fields, size_t vertex_count) {
  if (fields.size() < 4) return std::nullopt;
  std::vector<uint32_t> polygon;
  for (size_t k = 1; k < fields.size(); ++k) {
    const std::string corner = fields[k].substr(0, fields[k].find('/'));
    int64_t index = 0;
    const auto [end, error] = std::from_chars(corner.data(), corner.data() + corner.size(), index);
    if (error != std::errc() || end != corner.data() + corner.size() || index == 0) return std::nullopt;
    index = index > 0 ? index - 1 : static_cast<int64_t>(vertex_count) + index;
    if (index < 0 || index > UINT32_MAX) return std::nullopt;
    polygon.push_back(static_cast<uint32_t>(index));
  }
  return polygon;
}

}  // namespace

absl::StatusOr<Mesh> ReadObj(const std::string& path) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<TableLine> lines, ReadTable(path, ' '));
  Mesh mesh;
  for (const TableLine& line : lines) {
    if (line.fields[0] == "v") {
      const std::optional<Eigen::Vector3f> vertex = ParseVertex(line.fields);
      if (!vertex) return InvalidArgument("{}:{}: should be 'v x y z'", path, line.number);
      mesh.vertices.push_back(*vertex);
    } else if (line.fields[0] == "f") {
      const auto polygon = ParseFace(line.fields, mesh.vertices.size());
      if (!polygon) return InvalidArgument("{}:{}: should be 'f a b c...', vertex numbers from 1", path, line.number);
      AppendFan(*polygon, &mesh.triangles);
    }
  }
  ROMAP_RETURN_IF_ERROR(ValidateMesh(mesh, path));
  return mesh;
}

}  // namespace romap::files
