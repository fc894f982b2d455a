#include "server/texture/surface_texels.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "common/mesh_faces.h"
#include "server/texture/mesh_edges.h"

namespace romap::texture {
namespace {

constexpr int kBesideCharts_px = 2;
constexpr int kTile_px = 32;
constexpr int kMostSteps = 4;
constexpr float kContinuedCosine = 0.87f;  // 30 degrees

// Barycentric coordinates in one triangle of the atlas, in texels; the centers of texels have integer coordinates.
class AtlasTriangle {
 public:
  AtlasTriangle(const TexturedMesh& textured, uint32_t face) {
    for (int i = 0; i < 3; ++i) {
      corner_[i] = textured.mesh.uv[textured.mesh.triangles[face][i]] * static_cast<float>(textured.atlas_px) -
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

class TexelMaker {
 public:
  explicit TexelMaker(const TexturedMesh& textured)
      : textured_(textured), shapes_(textured.mesh), in_chart_(FindFaceNeighbors(textured.mesh.triangles)) {
    const std::vector<uint32_t> number = NumberByPosition(textured.mesh);
    std::vector<std::array<uint32_t, 3>> joined = textured.mesh.triangles;
    for (auto& triangle : joined) {
      for (uint32_t& vertex : triangle) vertex = number[vertex];
    }
    in_mesh_ = FindFaceNeighbors(joined);
  }

  // `face` is at the texel or near it.
  SurfaceTexel Make(uint32_t face, int x, int y) const {
    const Mesh& mesh = textured_.mesh;
    face = NearestFace(face, x, y);
    SurfaceTexel texel;
    texel.face = face;
    texel.index = static_cast<uint32_t>(y * textured_.atlas_px + x);
    const Eigen::Vector3f in_plane = AtlasTriangle(textured_, face).Barycentric(x, y);
    const Eigen::Vector3f on_edge = in_plane.cwiseMax(0.0f) / in_plane.cwiseMax(0.0f).sum();
    texel.barycentric = IsContinued(face, in_plane) ? in_plane : on_edge;
    texel.position = Eigen::Vector3f::Zero();
    Eigen::Vector3f vertex_normal = Eigen::Vector3f::Zero();
    for (int i = 0; i < 3; ++i) {
      const uint32_t vertex = mesh.triangles[face][i];
      texel.position += texel.barycentric[i] * mesh.vertices[vertex];
      if (!mesh.normals.empty()) vertex_normal += on_edge[i] * mesh.normals[vertex];
    }
    // Vertex normals are smooth but tilted at edges; triangle normals are noisy.
    texel.normal = (vertex_normal + shapes_.normal[face]).normalized();
    return texel;
  }

 private:
  // Walks toward the texel within the chart.
  uint32_t NearestFace(uint32_t face, int x, int y) const {
    for (int step = 0; step < kMostSteps; ++step) {
      int corner = 0;
      if (AtlasTriangle(textured_, face).Barycentric(x, y).minCoeff(&corner) >= 0) break;
      const uint32_t next = in_chart_[face][(corner + 1) % 3];  // across the edge opposite to the corner
      if (next == kNoFace || !AtlasTriangle(textured_, next).HasArea()) break;
      face = next;
    }
    return face;
  }

  // Whether the mesh goes on in about the same direction at a texel.
  bool IsContinued(uint32_t face, const Eigen::Vector3f& in_plane) const {
    for (int corner = 0; corner < 3; ++corner) {
      if (in_plane[corner] >= 0) continue;
      const uint32_t next = in_mesh_[face][(corner + 1) % 3];
      if (next == kNoFace || shapes_.normal[face].dot(shapes_.normal[next]) < kContinuedCosine) return false;
    }
    return true;
  }

  const TexturedMesh& textured_;
  const FaceShapes shapes_;
  const std::vector<FaceNeighbors> in_chart_;
  std::vector<FaceNeighbors> in_mesh_;  // across the borders of charts, too
};

}  // namespace

std::vector<SurfaceTexel> FindSurfaceTexels(const TexturedMesh& textured) {
  std::vector<uint32_t> face_at = RasterizeFaces(textured);
  for (int i = 0; i < kBesideCharts_px; ++i) GrowFaces(textured.atlas_px, face_at);
  const TexelMaker maker(textured);
  std::vector<SurfaceTexel> texels;
  texels.reserve(face_at.size() - static_cast<size_t>(std::count(face_at.begin(), face_at.end(), kNoFace)));
  const auto side = textured.atlas_px;
  for (int tile_y = 0; tile_y < side; tile_y += kTile_px) {
    for (int tile_x = 0; tile_x < side; tile_x += kTile_px) {
      for (int y = tile_y; y < std::min(tile_y + kTile_px, side); ++y) {
        for (int x = tile_x; x < std::min(tile_x + kTile_px, side); ++x) {
          const uint32_t face = face_at[static_cast<size_t>(y * side + x)];
          if (face != kNoFace) texels.push_back(maker.Make(face, x, y));
        }
      }
    }
  }
  return texels;
}

}  // namespace romap::texture
