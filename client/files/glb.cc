#include "client/files/glb.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <numbers>
#include <span>

#include "client/files/mesh_file.h"
#include "client/files/text_file.h"

namespace romap::files {
namespace {

static_assert(std::endian::native == std::endian::little, "glTF is little endian and so must be the bytes copied");

using Json = nlohmann::ordered_json;

// Numbers of the glTF 2.0 specification.
constexpr int kUnsignedShort = 5123;
constexpr int kUnsignedInt = 5125;
constexpr int kFloat = 5126;
constexpr int kArrayBuffer = 34962;
constexpr int kElementArrayBuffer = 34963;
constexpr int kPoints = 0;
constexpr int kTriangles = 4;
constexpr uint32_t kMagic = 0x46546C67;      // "glTF"
constexpr uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr uint32_t kBinChunk = 0x004E4942;   // "BIN"

// The binary part and the JSON that describes it, grown together.
struct Buffers {
  std::string bytes;
  Json views = Json::array();
  Json accessors = Json::array();

  // Adds an array of whole 4-byte multiples; returns its accessor, to which the caller may add.
  template <class T>
  int Add(std::span<const T> items, int component_type, const char* type, int target, size_t count) {
    static_assert(sizeof(T) % 4 == 0, "glTF wants every array aligned to 4 bytes");
    views.push_back(
        {{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", items.size_bytes()}, {"target", target}});
    bytes.append(reinterpret_cast<const char*>(items.data()), items.size_bytes());
    accessors.push_back(
        {{"bufferView", views.size() - 1}, {"componentType", component_type}, {"count", count}, {"type", type}});
    return static_cast<int>(accessors.size()) - 1;
  }
};

Json ToJson(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }

uint16_t LinearFromSrgb(uint8_t value) {
  const double c = value / 255.0;
  const double linear = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
  return static_cast<uint16_t>(std::lround(65535 * linear));
}

int AddPositions(const Mesh& mesh, Buffers* buffers) {
  Eigen::Vector3f low = mesh.vertices.front(), high = low;
  for (const Eigen::Vector3f& vertex : mesh.vertices) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  const int accessor = buffers->Add<Eigen::Vector3f>(mesh.vertices, kFloat, "VEC3", kArrayBuffer, mesh.vertices.size());
  buffers->accessors[accessor]["min"] = ToJson(low);
  buffers->accessors[accessor]["max"] = ToJson(high);
  return accessor;
}

int AddNormals(const Mesh& mesh, Buffers* buffers) {
  std::vector<Eigen::Vector3f> normals = mesh.normals;
  for (Eigen::Vector3f& normal : normals) {
    const float length = normal.norm();
    normal = length > 1e-12f ? Eigen::Vector3f(normal / length) : Eigen::Vector3f(0, 0, 1);  // glTF: unit length
  }
  return buffers->Add<Eigen::Vector3f>(normals, kFloat, "VEC3", kArrayBuffer, normals.size());
}

int AddColors(const Mesh& mesh, Buffers* buffers) {
  std::vector<std::array<uint16_t, 4>> colors;
  colors.reserve(mesh.colors.size());
  for (const Rgb8& color : mesh.colors) {
    colors.push_back({LinearFromSrgb(color[0]), LinearFromSrgb(color[1]), LinearFromSrgb(color[2]), 65535});
  }
  const int accessor =
      buffers->Add<std::array<uint16_t, 4>>(colors, kUnsignedShort, "VEC4", kArrayBuffer, colors.size());
  buffers->accessors[accessor]["normalized"] = true;
  return accessor;
}

Json Document(const Mesh& mesh, const std::string& name, Buffers* buffers) {
  Json primitive = {{"attributes", {{"POSITION", AddPositions(mesh, buffers)}}}, {"material", 0}};
  if (!mesh.normals.empty()) primitive["attributes"]["NORMAL"] = AddNormals(mesh, buffers);
  if (!mesh.colors.empty()) primitive["attributes"]["COLOR_0"] = AddColors(mesh, buffers);
  primitive["mode"] = mesh.triangles.empty() ? kPoints : kTriangles;
  if (!mesh.triangles.empty()) {
    primitive["indices"] = buffers->Add<std::array<uint32_t, 3>>(mesh.triangles, kUnsignedInt, "SCALAR",
                                                                 kElementArrayBuffer, 3 * mesh.triangles.size());
  }
  constexpr double kHalf = std::numbers::sqrt2 / 2;
  Json document;
  document["asset"] = {{"version", "2.0"}, {"generator", "romap"}};
  document["scene"] = 0;
  document["scenes"] = Json::array({{{"nodes", {0}}}});
  document["nodes"] = Json::array({{{"name", name}, {"mesh", 0}, {"rotation", {-kHalf, 0, 0, kHalf}}}});
  document["meshes"] = Json::array({{{"name", name}, {"primitives", Json::array({primitive})}}});
  document["materials"] =
      Json::array({{{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}}, {"doubleSided", true}}});
  document["buffers"] = Json::array({{{"byteLength", buffers->bytes.size()}}});
  document["bufferViews"] = buffers->views;
  document["accessors"] = buffers->accessors;
  return document;
}

void AppendWord(uint32_t word, std::string* bytes) {
  bytes->append(reinterpret_cast<const char*>(&word), sizeof(word));
}

void AppendChunk(uint32_t type, std::string chunk, char padding, std::string* bytes) {
  chunk.resize((chunk.size() + 3) / 4 * 4, padding);
  AppendWord(static_cast<uint32_t>(chunk.size()), bytes);
  AppendWord(type, bytes);
  *bytes += chunk;
}

}  // namespace

absl::StatusOr<std::string> EncodeGlb(const Mesh& mesh, const std::string& name) {
  ROMAP_RETURN_IF_ERROR(ValidateMesh(mesh, name));
  const auto fits = [&](size_t size) { return size == 0 || size == mesh.vertices.size(); };
  if (!fits(mesh.normals.size()) || !fits(mesh.colors.size())) {
    return InvalidArgument("{}: {} normals and {} colours for {} vertices", name, mesh.normals.size(),
                           mesh.colors.size(), mesh.vertices.size());
  }
  Buffers buffers;
  const Json document = Document(mesh, name, &buffers);
  std::string chunks;
  AppendChunk(kJsonChunk, document.dump(-1, ' ', false, Json::error_handler_t::replace), ' ', &chunks);
  AppendChunk(kBinChunk, std::move(buffers.bytes), '\0', &chunks);
  constexpr size_t kHeaderBytes = 12;
  if (chunks.size() + kHeaderBytes > UINT32_MAX) return InvalidArgument("{}: too large for GLB (4 GiB)", name);
  std::string bytes;
  AppendWord(kMagic, &bytes);
  AppendWord(2, &bytes);  // version
  AppendWord(static_cast<uint32_t>(chunks.size() + kHeaderBytes), &bytes);
  return bytes + chunks;
}

absl::Status WriteGlb(const std::string& path, const Mesh& mesh, const std::string& name) {
  ROMAP_ASSIGN_OR_RETURN(const std::string bytes, EncodeGlb(mesh, name));
  return WriteFile(path, bytes);
}

}  // namespace romap::files
