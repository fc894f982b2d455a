#include "server/texture/surface_texels.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "server/texture/mesh_edges.h"

namespace romap::texture {
namespace {

constexpr int kBesideCharts_px = 2;

// Barycentric coordinates in one triangle of the atlas, in texels; the centers of texels have integer coordinates.
class AtlasTriangle {
 public:
  AtlasTriangle(const TexturedMesh& textured, uint32_t face) {
    for (int i = 0; i < 3; ++i) {
      corner_[i] = textured.uv[textured.mesh.triangles[face][i]] * static_cast<float>(textured.atlas_px) -
                   Eigen::Vector2f::Constant(0.5f);
    }
    const Eigen::Vector2f u = corner_[1] - corner_[0], v = corner_[2] - corner_[0];
    const float determinant = u.x() * v.y() - u.y() * v.x();
    if (determinant == 0) return;
    has_area_ = true;
    to_second_ = Eigen::Vector2f(v.y(), -v.x()) / determinant;
    to_third_ = Eigen::Vector2f(-u.y(), u.x()) / determinant;
  }

  bool HasArea() const { return has_area_; }
  Eigen::Vector2f Low() const { return corner_[0].cwiseMin(corner_[1]).cwiseMin(corner_[2]); }
  Eigen::Vector2f High() const { return corner_[0].cwiseMax(corner_[1]).cwiseMax(corner_[2]); }
  Eigen::Vector3f Barycentric(int x, int y) const {
    const Eigen::Vector2f d = Eigen::Vector2f(static_cast<float>(x), static_cast<float>(y)) - corner_[0];
    const float second = to_second_.dot(d), third = to_third_.dot(d);
    return {1 - second - third, second, third};
  }

 private:
  std::array<Eigen::Vector2f, 3> corner_;
  Eigen::Vector2f to_second_ = Eigen::Vector2f::Zero(), to_third_ = Eigen::Vector2f::Zero();
  bool has_area_ = false;
};

// The triangle that each texel shows; kNoFace: none.
std::vector<uint32_t> RasterizeFaces(const TexturedMesh& textured) {
  const int side = textured.atlas_px;
  std::vector<uint32_t> face_at(static_cast<size_t>(side) * static_cast<size_t>(side), kNoFace);
  for (uint32_t face = 0; face < textured.mesh.triangles.size(); ++face) {
    const AtlasTriangle triangle(textured, face);
    if (!triangle.HasArea()) continue;
    const Eigen::Vector2f low = triangle.Low(), high = triangle.High();
    const int x0 = std::max(static_cast<int>(std::ceil(low.x())), 0);
    const int x1 = std::min(static_cast<int>(std::floor(high.x())), side - 1);
    const int y1 = std::min(static_cast<int>(std::floor(high.y())), side - 1);
    for (int y = std::max(static_cast<int>(std::ceil(low.y())), 0); y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        if (triangle.Barycentric(x, y).minCoeff() >= 0) face_at[static_cast<size_t>(y * side + x)] = face;
      }
    }
  }
  return face_at;
}

// Gives the triangles of texels to those beside them.
void GrowFaces(int side, std::vector<uint32_t>& face_at) {
  const std::vector<uint32_t> before = face_at;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      uint32_t& face = face_at[static_cast<size_t>(y * side + x)];
      if (face != kNoFace) continue;
      // Neighbors along an edge are nearer than those across a corner.
      constexpr std::array<std::array<int, 2>, 8> kSteps = {
          {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}}};
      for (const auto& [dx, dy] : kSteps) {
        if (x + dx < 0 || x + dx >= side || y + dy < 0 || y + dy >= side) continue;
        face = before[static_cast<size_t>((y + dy) * side + x + dx)];
        if (face != kNoFace) break;
      }
    }
  }
}

}  // namespace

std::vector<SurfaceTexel> FindSurfaceTexels(const TexturedMesh& textured) {
  const Mesh& mesh = textured.mesh;
  std::vector<uint32_t> face_at = RasterizeFaces(textured);
  for (int i = 0; i < kBesideCharts_px; ++i) GrowFaces(textured.atlas_px, face_at);
  const FaceShapes shapes(mesh);
  std::vector<SurfaceTexel> texels;
  texels.reserve(face_at.size() - static_cast<size_t>(std::count(face_at.begin(), face_at.end(), kNoFace)));
  for (uint32_t index = 0; index < face_at.size(); ++index) {
    const uint32_t face = face_at[index];
    if (face == kNoFace) continue;
    const auto side = static_cast<uint32_t>(textured.atlas_px);
    SurfaceTexel texel;
    texel.index = index;
    texel.face = face;
    texel.barycentric = AtlasTriangle(textured, face)
                            .Barycentric(static_cast<int>(index % side), static_cast<int>(index / side))
                            .cwiseMax(0.0f);
    texel.barycentric /= texel.barycentric.sum();
    texel.position = Eigen::Vector3f::Zero();
    Eigen::Vector3f vertex_normal = Eigen::Vector3f::Zero();
    for (int i = 0; i < 3; ++i) {
      const uint32_t vertex = mesh.triangles[face][i];
      texel.position += texel.barycentric[i] * mesh.vertices[vertex];
      if (!mesh.normals.empty()) vertex_normal += texel.barycentric[i] * mesh.normals[vertex];
    }
    // Vertex normals are smooth but tilted at edges; triangle normals are noisy.
    texel.normal = (vertex_normal + shapes.normal[face]).normalized();
    texels.push_back(texel);
  }
  return texels;
}

}  // namespace romap::texture
