#include "common/mesh_codec.h"

#include <draco/compression/decode.h>
#include <draco/compression/encode.h>
#include <draco/core/varint_decoding.h>
#include <draco/mesh/mesh.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <memory>
#include <utility>
#include <vector>

#include "common/status.h"

namespace romap {
namespace {

using draco::GeometryAttribute;

bool IsDegenerate(const std::array<uint32_t, 3>& triangle) {
  const auto& [a, b, c] = triangle;
  return a == b || b == c || c == a;
}

absl::Status ValidateOptions(const DracoOptions& options) {
  if (options.position_bits < 1 || options.position_bits > 30) {
    return InvalidArgument("position_bits must be 1..30, got {}", options.position_bits);
  }
  if (options.normal_bits < 2 || options.normal_bits > 30) {
    return InvalidArgument("normal_bits must be 2..30, got {}", options.normal_bits);
  }
  if (options.uv_bits < 2 || options.uv_bits > 30) {
    return InvalidArgument("uv_bits must be 2..30, got {}", options.uv_bits);
  }
  if (options.speed < 0 || options.speed > 10) return InvalidArgument("speed must be 0..10, got {}", options.speed);
  return absl::OkStatus();
}

absl::Status ValidateMesh(const Mesh& mesh) {
  const size_t vertices = mesh.vertices.size();
  if (mesh.triangles.size() > kMaxCodecTriangles || vertices > 3 * kMaxCodecTriangles) {
    return InvalidArgument("mesh has {} triangles and {} vertices; the limits are {} and {}", mesh.triangles.size(),
                           vertices, kMaxCodecTriangles, 3 * kMaxCodecTriangles);
  }
  if (!mesh.normals.empty() && mesh.normals.size() != vertices) {
    return InvalidArgument("mesh has {} normals for {} vertices", mesh.normals.size(), vertices);
  }
  if (!mesh.colors.empty() && mesh.colors.size() != vertices) {
    return InvalidArgument("mesh has {} colors for {} vertices", mesh.colors.size(), vertices);
  }
  if (!mesh.confidence.empty() && mesh.confidence.size() != vertices) {
    return InvalidArgument("mesh has {} confidences for {} vertices", mesh.confidence.size(), vertices);
  }
  if (!mesh.uv.empty() && mesh.uv.size() != vertices) {
    return InvalidArgument("mesh has {} texture coordinates for {} vertices", mesh.uv.size(), vertices);
  }
  for (size_t i = 0; i < vertices; ++i) {
    if (!mesh.uv.empty() && !mesh.uv[i].allFinite()) return InvalidArgument("texture coordinate {} is not finite", i);
    if (!mesh.vertices[i].allFinite()) return InvalidArgument("vertex {} is not finite", i);
    if (!mesh.normals.empty() && !mesh.normals[i].allFinite()) return InvalidArgument("normal {} is not finite", i);
  }
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (const uint32_t index : mesh.triangles[i]) {
      if (index >= vertices)
        return InvalidArgument("triangle {} uses vertex {}, but the mesh has {} vertices", i, index, vertices);
    }
  }
  return absl::OkStatus();
}

// Number of components of one value.
template <class Value>
constexpr int ComponentsOf() {
  return static_cast<int>(sizeof(Value) / sizeof(std::declval<Value>()[0]));
}

// One value per vertex.
template <class Value>
void AddAttribute(GeometryAttribute::Type type, draco::DataType data_type, const std::vector<Value>& values,
                  draco::Mesh& target) {
  GeometryAttribute description;
  description.Init(type, nullptr, ComponentsOf<Value>(), data_type, /*normalized=*/data_type == draco::DT_UINT8,
                   sizeof(Value),
                   /*byte_offset=*/0);
  const int id = target.AddAttribute(description, /*identity_mapping=*/true, static_cast<uint32_t>(values.size()));
  for (size_t i = 0; i < values.size(); ++i) {
    target.attribute(id)->SetAttributeValue(draco::AttributeValueIndex(static_cast<uint32_t>(i)), values[i].data());
  }
}

using ConfidenceByte = std::array<uint8_t, 1>;  // 0..255 for 0..1

std::vector<ConfidenceByte> ToBytes(const std::vector<float>& confidence) {
  std::vector<ConfidenceByte> bytes;
  bytes.reserve(confidence.size());
  for (const float value : confidence) {
    bytes.push_back({static_cast<uint8_t>(std::lround(255 * std::clamp(value, 0.0F, 1.0F)))});
  }
  return bytes;
}

void FillDraco(const Mesh& mesh, draco::Mesh& target) {
  target.set_num_points(static_cast<uint32_t>(mesh.vertices.size()));
  for (const auto& triangle : mesh.triangles) {
    if (IsDegenerate(triangle)) continue;
    target.AddFace({draco::PointIndex(triangle[0]), draco::PointIndex(triangle[1]), draco::PointIndex(triangle[2])});
  }
  AddAttribute(GeometryAttribute::POSITION, draco::DT_FLOAT32, mesh.vertices, target);
  if (!mesh.normals.empty()) AddAttribute(GeometryAttribute::NORMAL, draco::DT_FLOAT32, mesh.normals, target);
  if (!mesh.colors.empty()) AddAttribute(GeometryAttribute::COLOR, draco::DT_UINT8, mesh.colors, target);
  if (!mesh.uv.empty()) AddAttribute(GeometryAttribute::TEX_COORD, draco::DT_FLOAT32, mesh.uv, target);
  if (!mesh.confidence.empty()) {
    AddAttribute(GeometryAttribute::GENERIC, draco::DT_UINT8, ToBytes(mesh.confidence), target);
  }
}

// Draco allocates memory for the counts in the header before it checks whether the stream is long enough, so the counts
// are checked first. Layout of a 2.2 stream: "DRACO", major, minor, geometry, method, flags (2 bytes), then for
// edgebreaker: traversal, vertex count and triangle count (varints).
absl::Status CheckHeader(const std::string& bytes) {
  draco::DecoderBuffer buffer;
  buffer.Init(bytes.data(), bytes.size());
  char magic[5];
  uint8_t major = 0, minor = 0, geometry = 0, method = 0, traversal = 0;
  uint16_t flags = 0;
  uint32_t vertices = 0, triangles = 0;
  if (!buffer.Decode(magic, sizeof(magic)) || std::string(magic, sizeof(magic)) != "DRACO") {
    return InvalidArgument("not a Draco mesh: the {} bytes do not start with DRACO", bytes.size());
  }
  const bool complete = buffer.Decode(&major) && buffer.Decode(&minor) && buffer.Decode(&geometry) &&
                        buffer.Decode(&method) && buffer.Decode(&flags) && buffer.Decode(&traversal) &&
                        draco::DecodeVarint(&vertices, &buffer) && draco::DecodeVarint(&triangles, &buffer);
  if (!complete) return InvalidArgument("Draco mesh is truncated after {} bytes", bytes.size());
  if (major != 2 || minor != 2 || geometry != draco::TRIANGULAR_MESH || method != draco::MESH_EDGEBREAKER_ENCODING ||
      flags != 0) {
    return InvalidArgument(
        "Draco stream has version {}.{}, geometry {}, method {}, flags {}; must be 2.2, 1 (mesh), 1 (edgebreaker), 0",
        major, minor, geometry, method, flags);
  }
  if (triangles > kMaxCodecTriangles || vertices > 3 * kMaxCodecTriangles) {
    return InvalidArgument("Draco header has {} triangles and {} vertices; the limits are {} and {}", triangles,
                           vertices, kMaxCodecTriangles, 3 * kMaxCodecTriangles);
  }
  return absl::OkStatus();
}

// The values of an attribute by point; empty if the stream does not have the attribute.
template <class Value>
absl::StatusOr<std::vector<Value>> ReadAttribute(const draco::Mesh& source, GeometryAttribute::Type type,
                                                 draco::DataType data_type) {
  std::vector<Value> values;
  const draco::PointAttribute* attribute = source.GetNamedAttribute(type);
  if (attribute == nullptr) return values;
  if (attribute->num_components() != ComponentsOf<Value>() || attribute->data_type() != data_type) {
    return InvalidArgument("Draco mesh: {} has {} components of type {}; must be {} of type {}",
                           GeometryAttribute::TypeToString(type), attribute->num_components(),
                           static_cast<int>(attribute->data_type()), ComponentsOf<Value>(),
                           static_cast<int>(data_type));
  }
  values.resize(source.num_points());
  for (uint32_t i = 0; i < source.num_points(); ++i) {
    const draco::AttributeValueIndex index = attribute->mapped_index(draco::PointIndex(i));
    if (index.value() >= attribute->size()) return InvalidArgument("Draco mesh: point {} has no value", i);
    attribute->GetValue(index, values[i].data());
  }
  return values;
}

absl::StatusOr<Mesh> FromDraco(const draco::Mesh& source) {
  Mesh mesh;
  ROMAP_ASSIGN_OR_RETURN(mesh.vertices,
                         ReadAttribute<Eigen::Vector3f>(source, GeometryAttribute::POSITION, draco::DT_FLOAT32));
  ROMAP_ASSIGN_OR_RETURN(mesh.normals,
                         ReadAttribute<Eigen::Vector3f>(source, GeometryAttribute::NORMAL, draco::DT_FLOAT32));
  ROMAP_ASSIGN_OR_RETURN(mesh.colors, ReadAttribute<Rgb8>(source, GeometryAttribute::COLOR, draco::DT_UINT8));
  ROMAP_ASSIGN_OR_RETURN(mesh.uv,
                         ReadAttribute<Eigen::Vector2f>(source, GeometryAttribute::TEX_COORD, draco::DT_FLOAT32));
  ROMAP_ASSIGN_OR_RETURN(const std::vector<ConfidenceByte> confidence,
                         ReadAttribute<ConfidenceByte>(source, GeometryAttribute::GENERIC, draco::DT_UINT8));
  for (const ConfidenceByte& byte : confidence) mesh.confidence.push_back(static_cast<float>(byte[0]) / 255.0F);
  for (uint32_t i = 0; i < source.num_faces(); ++i) {
    const draco::Mesh::Face& face = source.face(draco::FaceIndex(i));
    mesh.triangles.push_back({face[0].value(), face[1].value(), face[2].value()});
  }
  ROMAP_RETURN_IF_ERROR(ValidateMesh(mesh));
  return mesh;
}

}  // namespace

absl::StatusOr<std::string> EncodeDraco(const Mesh& mesh, const DracoOptions& options) {
  ROMAP_RETURN_IF_ERROR(ValidateOptions(options));
  ROMAP_RETURN_IF_ERROR(ValidateMesh(mesh));
  try {
    draco::Mesh source;
    FillDraco(mesh, source);
    if (source.num_faces() == 0) {
      return InvalidArgument("mesh has no triangle with three different vertices, in {} triangles",
                             mesh.triangles.size());
    }
    draco::Encoder encoder;
    encoder.SetEncodingMethod(draco::MESH_EDGEBREAKER_ENCODING);
    encoder.SetSpeedOptions(options.speed, options.speed);
    encoder.SetAttributeQuantization(GeometryAttribute::POSITION, options.position_bits);
    encoder.SetAttributeQuantization(GeometryAttribute::NORMAL, options.normal_bits);
    encoder.SetAttributeQuantization(GeometryAttribute::TEX_COORD, options.uv_bits);
    draco::EncoderBuffer buffer;
    const draco::Status status = encoder.EncodeMeshToBuffer(source, &buffer);
    if (!status.ok()) return Internal("Draco encoder: {}", status.error_msg_string());
    return std::string(buffer.data(), buffer.size());
  } catch (const std::exception& e) {
    return Internal("Draco encoder: {}", e.what());
  }
}

absl::StatusOr<Mesh> DecodeDraco(const std::string& bytes) {
  ROMAP_RETURN_IF_ERROR(CheckHeader(bytes));
  try {
    draco::DecoderBuffer buffer;
    buffer.Init(bytes.data(), bytes.size());
    draco::Decoder decoder;
    auto mesh = decoder.DecodeMeshFromBuffer(&buffer);
    if (!mesh.ok()) return InvalidArgument("Draco decoder: {}", mesh.status().error_msg_string());
    return FromDraco(*mesh.value());
  } catch (const std::exception& e) {
    return InvalidArgument("Draco decoder: {}", e.what());
  }
}

}  // namespace romap
