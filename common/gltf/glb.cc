#include "common/gltf/glb.h"

#include <tiny_gltf.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>
#include <span>
#include <sstream>
#include <utility>
#include <vector>

#include "common/mesh_faces.h"
#include "common/status.h"

namespace romap {
namespace {

static_assert(std::endian::native == std::endian::little,
              "glTF is little endian, and arrays are copied without byte swapping");

// Appends an array to the model's buffer. Returns the index of its accessor; the caller sets further properties.
template <class T>
int AddArray(std::span<const T> items, int component_type, int type, int target, size_t count, tinygltf::Model* model) {
  static_assert(sizeof(T) % 4 == 0, "glTF aligns every array to 4 bytes");
  std::vector<unsigned char>& bytes = model->buffers.front().data;
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = bytes.size();
  view.byteLength = items.size_bytes();
  view.target = target;
  bytes.resize(bytes.size() + items.size_bytes());
  std::memcpy(bytes.data() + view.byteOffset, items.data(), items.size_bytes());
  model->bufferViews.push_back(std::move(view));

  tinygltf::Accessor accessor;
  accessor.bufferView = static_cast<int>(model->bufferViews.size()) - 1;
  accessor.componentType = component_type;
  accessor.type = type;
  accessor.count = count;
  model->accessors.push_back(std::move(accessor));
  return static_cast<int>(model->accessors.size()) - 1;
}

uint16_t LinearFromSrgb(uint8_t value) {
  const double c = value / 255.0;
  const double linear = c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4);
  return static_cast<uint16_t>(std::lround(65535 * linear));
}

int AddPositions(const Mesh& mesh, tinygltf::Model* model) {
  const Eigen::AlignedBox3f bounds = BoundsOf(mesh);
  const int index = AddArray<Eigen::Vector3f>(mesh.vertices, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3,
                                              TINYGLTF_TARGET_ARRAY_BUFFER, mesh.vertices.size(), model);
  model->accessors[index].minValues.assign(bounds.min().data(), bounds.min().data() + 3);
  model->accessors[index].maxValues.assign(bounds.max().data(), bounds.max().data() + 3);
  return index;
}

int AddNormals(const Mesh& mesh, tinygltf::Model* model) {
  std::vector<Eigen::Vector3f> normals = mesh.normals;
  for (Eigen::Vector3f& normal : normals) {
    const float length = normal.norm();
    // glTF requires unit length, also where the normal is undefined.
    normal = length > 1e-12f ? Eigen::Vector3f(normal / length) : Eigen::Vector3f(0, 0, 1);
  }
  return AddArray<Eigen::Vector3f>(normals, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC3,
                                   TINYGLTF_TARGET_ARRAY_BUFFER, normals.size(), model);
}

int AddColors(const Mesh& mesh, tinygltf::Model* model) {
  std::vector<std::array<uint16_t, 4>> colors;
  colors.reserve(mesh.colors.size());
  for (const Rgb8& color : mesh.colors) {
    colors.push_back({LinearFromSrgb(color[0]), LinearFromSrgb(color[1]), LinearFromSrgb(color[2]), 65535});
  }
  const int index =
      AddArray<std::array<uint16_t, 4>>(colors, TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, TINYGLTF_TYPE_VEC4,
                                        TINYGLTF_TARGET_ARRAY_BUFFER, colors.size(), model);
  model->accessors[index].normalized = true;
  return index;
}

// Stores the texture in the buffer, and uses it in the material.
void AddTexture(const MeshTexture& texture, tinygltf::Material* material, tinygltf::Model* model) {
  std::vector<unsigned char>& bytes = model->buffers.front().data;
  tinygltf::BufferView view;
  view.buffer = 0;
  view.byteOffset = bytes.size();
  view.byteLength = texture.image.size();
  bytes.insert(bytes.end(), texture.image.begin(), texture.image.end());
  while (bytes.size() % 4 != 0) bytes.push_back(0);
  model->bufferViews.push_back(std::move(view));
  tinygltf::Image image;
  image.mimeType = texture.media_type;
  image.bufferView = static_cast<int>(model->bufferViews.size()) - 1;
  model->images.push_back(std::move(image));
  tinygltf::Sampler sampler;
  sampler.minFilter = TINYGLTF_TEXTURE_FILTER_LINEAR_MIPMAP_LINEAR;
  sampler.magFilter = TINYGLTF_TEXTURE_FILTER_LINEAR;
  sampler.wrapS = sampler.wrapT = TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE;
  model->samplers.push_back(std::move(sampler));
  tinygltf::Texture reference;
  reference.sampler = 0;
  reference.source = 0;
  model->textures.push_back(std::move(reference));
  material->pbrMetallicRoughness.baseColorTexture.index = 0;
}

// Adds a mesh with its material.
void AddMesh(const GlbObject& object, tinygltf::Model* model) {
  const Mesh& mesh = *object.mesh;
  tinygltf::Primitive primitive;
  primitive.material = static_cast<int>(model->materials.size());
  primitive.mode = mesh.triangles.empty() ? TINYGLTF_MODE_POINTS : TINYGLTF_MODE_TRIANGLES;
  primitive.attributes["POSITION"] = AddPositions(mesh, model);
  if (!mesh.normals.empty()) primitive.attributes["NORMAL"] = AddNormals(mesh, model);
  const bool has_texture = !mesh.uv.empty() && !object.texture.image.empty();
  if (has_texture) {
    primitive.attributes["TEXCOORD_0"] =
        AddArray<Eigen::Vector2f>(mesh.uv, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_VEC2,
                                  TINYGLTF_TARGET_ARRAY_BUFFER, mesh.uv.size(), model);
  } else if (!mesh.colors.empty()) {  // glTF would multiply them with the texture
    primitive.attributes["COLOR_0"] = AddColors(mesh, model);
  }
  if (!mesh.confidence.empty()) {  // names of applications begin with an underscore
    primitive.attributes["_CONFIDENCE"] =
        AddArray<float>(mesh.confidence, TINYGLTF_COMPONENT_TYPE_FLOAT, TINYGLTF_TYPE_SCALAR,
                        TINYGLTF_TARGET_ARRAY_BUFFER, mesh.confidence.size(), model);
  }
  if (!mesh.triangles.empty()) {
    primitive.indices =
        AddArray<std::array<uint32_t, 3>>(mesh.triangles, TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, TINYGLTF_TYPE_SCALAR,
                                          TINYGLTF_TARGET_ELEMENT_ARRAY_BUFFER, 3 * mesh.triangles.size(), model);
  }
  tinygltf::Mesh gltf_mesh;
  gltf_mesh.name = object.name;
  gltf_mesh.primitives.push_back(std::move(primitive));
  model->meshes.push_back(std::move(gltf_mesh));

  tinygltf::Material material;
  material.doubleSided = true;
  material.pbrMetallicRoughness.metallicFactor = 0;
  material.pbrMetallicRoughness.roughnessFactor = 1;
  if (has_texture) AddTexture(object.texture, &material, model);
  model->materials.push_back(std::move(material));
}

// The node of the newest mesh.
tinygltf::Node MakeNode(const GlbObject& object, const tinygltf::Model& model) {
  tinygltf::Node node;
  node.name = object.name;
  node.mesh = static_cast<int>(model.meshes.size()) - 1;
  const Eigen::Vector3d& translation = object.S_world_mesh.translation();
  const Eigen::Vector4d& rotation = object.S_world_mesh.rotation().coeffs();  // x y z w
  node.translation.assign(translation.data(), translation.data() + 3);
  node.rotation.assign(rotation.data(), rotation.data() + 4);
  node.scale.assign(3, object.S_world_mesh.scale());
  return node;
}

tinygltf::Model ToModel(std::span<const GlbObject> objects) {
  tinygltf::Model model;
  model.asset.version = "2.0";
  model.asset.generator = "romap";
  if (!objects.empty()) model.buffers.emplace_back();
  constexpr double kHalf = std::numbers::sqrt2 / 2;
  tinygltf::Node world;
  world.name = "world";
  world.rotation = {-kHalf, 0, 0, kHalf};  // x y z w: -90 degrees about x, z up to y up
  model.nodes.push_back(std::move(world));
  for (const GlbObject& object : objects) {
    AddMesh(object, &model);
    model.nodes.front().children.push_back(static_cast<int>(model.nodes.size()));
    model.nodes.push_back(MakeNode(object, model));
  }
  tinygltf::Scene scene;
  scene.nodes = {0};
  model.scenes.push_back(std::move(scene));
  model.defaultScene = 0;
  return model;
}

absl::Status Check(const GlbObject& object, const std::string& name) {
  const Mesh& mesh = *object.mesh;
  ROMAP_RETURN_IF_ERROR(ValidateMesh(mesh, name));
  const auto fits = [&](size_t size) { return size == 0 || size == mesh.vertices.size(); };
  if (fits(mesh.normals.size()) && fits(mesh.colors.size()) && fits(mesh.uv.size()) && fits(mesh.confidence.size())) {
    return absl::OkStatus();
  }
  return InvalidArgument("{}: {} normals, {} colors, {} texture coordinates and {} confidences for {} vertices", name,
                         mesh.normals.size(), mesh.colors.size(), mesh.uv.size(), mesh.confidence.size(),
                         mesh.vertices.size());
}

}  // namespace

absl::StatusOr<std::string> EncodeGlb(std::span<const GlbObject> objects, const std::string& name) {
  for (const GlbObject& object : objects) ROMAP_RETURN_IF_ERROR(Check(object, name));
  const tinygltf::Model model = ToModel(objects);
  // Upper bound for the JSON chunk and the headers [bytes].
  const size_t json_reserve = (size_t{1} << 16) + objects.size() * (size_t{1} << 13);
  if (!model.buffers.empty() && model.buffers.front().data.size() + json_reserve > UINT32_MAX) {
    return InvalidArgument("{}: the meshes exceed the 4 GiB limit of GLB", name);
  }
  std::ostringstream stream;
  if (!tinygltf::TinyGLTF().WriteGltfSceneToStream(&model, stream, /*prettyPrint=*/false, /*writeBinary=*/true)) {
    return Internal("{}: cannot be encoded as GLB", name);
  }
  return std::move(stream).str();
}

}  // namespace romap
