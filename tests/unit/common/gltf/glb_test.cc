#include "common/gltf/glb.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstring>
#include <nlohmann/json.hpp>

#include "common/status.h"
#include "tests/support/streams.h"

namespace romap::glb_test {

uint32_t WordAt(const std::string& bytes, size_t offset) {
  uint32_t word = 0;
  std::memcpy(&word, bytes.data() + offset, sizeof(word));
  return word;
}

// A GLB file, parsed according to the specification.
struct Glb {
  explicit Glb(const std::vector<GlbObject>& objects) : Glb(EncodeGlb(objects, "map").value()) {}
  explicit Glb(const Mesh& mesh, const Sim3<World, Object>& S_world_mesh = {}, const MeshTexture& texture = {})
      : Glb(std::vector<GlbObject>{{.mesh = &mesh, .S_world_mesh = S_world_mesh, .texture = texture}}) {}
  explicit Glb(const std::string& bytes) {
    EXPECT_EQ(bytes.substr(0, 4), "glTF");
    EXPECT_EQ(WordAt(bytes, 4), 2u);
    EXPECT_EQ(WordAt(bytes, 8), bytes.size());
    const uint32_t json_bytes = WordAt(bytes, 12);
    EXPECT_EQ(bytes.substr(16, 4), "JSON");
    document = nlohmann::json::parse(bytes.substr(20, json_bytes));
    EXPECT_EQ(WordAt(bytes, 20 + json_bytes), bytes.size() - 28 - json_bytes);
    EXPECT_EQ(bytes.substr(24 + json_bytes, 4), std::string("BIN\0", 4));
    binary = bytes.substr(28 + json_bytes);
    EXPECT_EQ(json_bytes % 4, 0u);
    EXPECT_GE(binary.size(), document["buffers"][0]["byteLength"].get<size_t>());
  }

  // The scalars of type T of accessor `index`.
  template <class T>
  std::vector<T> Read(int index, size_t scalars_per_item) const {
    const auto& accessor = document["accessors"][index];
    const auto& view = document["bufferViews"][accessor["bufferView"].get<int>()];
    std::vector<T> items(accessor["count"].get<size_t>() * scalars_per_item);
    EXPECT_EQ(view["byteLength"].get<size_t>(), items.size() * sizeof(T));
    const size_t offset = view.value("byteOffset", size_t{0});
    EXPECT_EQ(offset % 4, 0u);
    EXPECT_LE(offset + items.size() * sizeof(T), binary.size());
    std::memcpy(items.data(), binary.data() + offset, items.size() * sizeof(T));
    return items;
  }

  nlohmann::json document;
  std::string binary;
};

Mesh Triangle() {
  Mesh mesh;
  mesh.vertices = {{0, 0, -1}, {2, 0, 0}, {0, 3, 0}};
  mesh.normals = {{0, 0, 2}, {0, 0, 0}, {0, 1, 0}};
  mesh.colors = {{255, 0, 188}, {0, 255, 0}, {1, 2, 3}};
  mesh.triangles = {{0, 1, 2}};
  return mesh;
}

TEST(GlbTest, StoresTheMeshAccordingToTheSpecification) {
  const Glb glb(Triangle());
  EXPECT_EQ(glb.document["asset"]["version"], "2.0");
  EXPECT_EQ(glb.document["scenes"][glb.document["scene"].get<int>()]["nodes"], nlohmann::json({0}));
  EXPECT_EQ(glb.document["nodes"][0]["children"], nlohmann::json({1}));
  EXPECT_EQ(glb.document["nodes"][1]["mesh"], 0);
  const auto& primitive = glb.document["meshes"][0]["primitives"][0];
  const int position = primitive["attributes"]["POSITION"];
  EXPECT_EQ(glb.Read<float>(position, 3), (std::vector<float>{0, 0, -1, 2, 0, 0, 0, 3, 0}));
  EXPECT_EQ(glb.document["accessors"][position]["min"], nlohmann::json({0.0, 0.0, -1.0}));
  EXPECT_EQ(glb.document["accessors"][position]["max"], nlohmann::json({2.0, 3.0, 0.0}));
  EXPECT_EQ(glb.Read<uint32_t>(primitive["indices"], 1), (std::vector<uint32_t>{0, 1, 2}));
  EXPECT_EQ(glb.Read<float>(primitive["attributes"]["NORMAL"], 3), (std::vector<float>{0, 0, 1, 0, 0, 1, 0, 1, 0}))
      << "unit length";
  const int color = primitive["attributes"]["COLOR_0"];
  EXPECT_TRUE(glb.document["accessors"][color]["normalized"].get<bool>());
  const auto colors = glb.Read<uint16_t>(color, 4);
  EXPECT_EQ(colors[0], 65535);
  EXPECT_NEAR(colors[2] / 65535.0, 0.5, 0.005) << "sRGB 188 is half of the maximum linear intensity";
  EXPECT_EQ(colors[3], 65535) << "opaque";
}

TEST(GlbTest, StoresTheTextureInsteadOfTheColors) {
  Mesh mesh = Triangle();
  mesh.uv = {{0, 0}, {0.5f, 0.25f}, {1, 1}};
  const MeshTexture texture = {std::string("\x89PNG\0five", 9), "image/png"};
  const Glb glb(mesh, {}, texture);
  const auto& attributes = glb.document["meshes"][0]["primitives"][0]["attributes"];
  EXPECT_FALSE(attributes.contains("COLOR_0"));
  EXPECT_EQ(glb.Read<float>(attributes["TEXCOORD_0"], 2), (std::vector<float>{0, 0, 0.5f, 0.25f, 1, 1}));
  const auto& material = glb.document["materials"][0]["pbrMetallicRoughness"];
  const auto& reference = glb.document["textures"][material["baseColorTexture"]["index"].get<int>()];
  const auto& image = glb.document["images"][reference["source"].get<int>()];
  EXPECT_EQ(image["mimeType"], "image/png");
  const auto& view = glb.document["bufferViews"][image["bufferView"].get<int>()];
  EXPECT_EQ(glb.binary.substr(view["byteOffset"], view["byteLength"]), texture.image);
  EXPECT_FALSE(Glb(mesh).document.contains("textures")) << "without a texture";
}

TEST(GlbTest, StoresTheConfidenceOfTheVertices) {
  Mesh mesh = Triangle();
  mesh.confidence = {0, 0.25f, 1};
  const Glb glb(mesh);
  const auto& attributes = glb.document["meshes"][0]["primitives"][0]["attributes"];
  EXPECT_EQ(glb.Read<float>(attributes["_CONFIDENCE"], 1), mesh.confidence);
  EXPECT_EQ(glb.document["accessors"][attributes["_CONFIDENCE"].get<int>()]["type"], "SCALAR");
}

TEST(GlbTest, RotatesZUpToYUp) {
  const Glb glb(Triangle());
  const auto q = glb.document["nodes"][0]["rotation"].get<std::vector<double>>();  // x y z w
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  EXPECT_TRUE((rotation * Eigen::Vector3d::UnitZ()).isApprox(Eigen::Vector3d::UnitY(), 1e-12));
  EXPECT_TRUE((rotation * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitX(), 1e-12));
}

TEST(GlbTest, StoresThePoseInTheNodeInDoublePrecision) {
  const Sim3<World, Object> S_world_mesh(
      1e-3, Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized())),
      Eigen::Vector3d(500'000.123456789, 6'400'000.25, -100.1));
  const Glb glb(Triangle(), S_world_mesh);
  const auto& node = glb.document["nodes"][1];
  EXPECT_EQ(node["translation"].get<std::vector<double>>(),
            (std::vector<double>{500'000.123456789, 6'400'000.25, -100.1}));
  EXPECT_EQ(node["scale"].get<std::vector<double>>(), std::vector<double>(3, 1e-3));
  const auto q = node["rotation"].get<std::vector<double>>();  // x y z w
  EXPECT_LT(S_world_mesh.rotation().angularDistance(Eigen::Quaterniond(q[3], q[0], q[1], q[2])), 1e-12);
  const int position = glb.document["meshes"][0]["primitives"][0]["attributes"]["POSITION"];
  EXPECT_EQ(glb.Read<float>(position, 3), (std::vector<float>{0, 0, -1, 2, 0, 0, 0, 3, 0})) << "unchanged";
}

TEST(GlbTest, WritesAMeshWithoutTrianglesAsPoints) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1, 1, 1}};
  const Glb glb(mesh);
  const auto& primitive = glb.document["meshes"][0]["primitives"][0];
  EXPECT_EQ(primitive["mode"], 0);
  EXPECT_FALSE(primitive.contains("indices"));
  EXPECT_FALSE(primitive["attributes"].contains("COLOR_0"));
}

TEST(GlbTest, StoresSeveralMeshesWithTheirNames) {
  const Mesh first = Triangle();
  Mesh second = Triangle();
  second.vertices[0] = {5, 5, 5};
  const Glb glb(std::vector<GlbObject>{{.mesh = &first, .name = "1_cup"}, {.mesh = &second, .name = "2_book"}});
  EXPECT_EQ(glb.document["nodes"][0]["children"], nlohmann::json({1, 2}));
  EXPECT_EQ(glb.document["nodes"][1]["name"], "1_cup");
  EXPECT_EQ(glb.document["nodes"][2]["name"], "2_book");
  const auto& mesh = glb.document["meshes"][glb.document["nodes"][2]["mesh"].get<int>()];
  const int position = mesh["primitives"][0]["attributes"]["POSITION"];
  EXPECT_EQ(glb.Read<float>(position, 3), (std::vector<float>{5, 5, 5, 2, 0, 0, 0, 3, 0}));
  EXPECT_EQ(glb.document["buffers"].size(), 1u);
}

TEST(GlbTest, AMapWithoutMeshesIsAnEmptyScene) {
  const std::string bytes = EncodeGlb({}, "map").value();
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(WordAt(bytes, 8), bytes.size());
  const nlohmann::json document = nlohmann::json::parse(bytes.substr(20, WordAt(bytes, 12)));
  EXPECT_FALSE(document.contains("meshes"));
  EXPECT_EQ(document["scenes"][0]["nodes"], nlohmann::json({0}));
}

TEST(GlbTest, RejectsInvalidMeshes) {
  const auto encode = [](const Mesh& mesh) {
    const GlbObject object{.mesh = &mesh};
    return EncodeGlb({&object, 1}, "cup.glb").status();
  };
  EXPECT_CODE(encode(Mesh()), absl::StatusCode::kInvalidArgument);
  Mesh mesh = Triangle();
  mesh.normals.pop_back();
  EXPECT_EQ(Message(encode(mesh)),
            "cup.glb: 2 normals, 3 colors, 0 texture coordinates and 0 confidences for 3 vertices");
  mesh = Triangle();
  mesh.triangles[0][1] = 3;
  EXPECT_CODE(encode(mesh), absl::StatusCode::kInvalidArgument);
}

}  // namespace romap::glb_test
