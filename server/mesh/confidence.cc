#include "server/mesh/confidence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "server/mesh/view_pixels.h"

namespace romap::mesh {
namespace {

// A view counts as sharp if the box is at least this long in it: about the resolution of a trained field.
constexpr float kSharpSide_px = 64.0f;
// Sum of weights that brings confidence to 1 - 1/e.
constexpr float kEnoughWeight = 2.0f;
// A vertex is hidden if the depth buffer is this many cells in front of it, plus the depth range of its own surface
// within two cells at the viewing angle, limited to a maximum slope.
constexpr float kHiddenCells = 1.5f;
constexpr float kMaxSlope = 4.0f;
// At most this many views are used, because more views add little; their weights are scaled up.
constexpr size_t kMaxViews = 16;
// Size of a bin of the depth buffer, large enough that a surface that faces the view leaves no bin empty.
constexpr float kBinCells = 2.0f;
// Largest side of the depth buffer. A larger one would be needed only if the camera were inside the object.
constexpr int kMaxSide = 512;
// Larger pixel coordinates are outside any image, and conversions to int could overflow.
constexpr float kMaxPixel = 1e6f;

// Vertices projected at a time, few enough to stay in the L1 cache.
constexpr Eigen::Index kBlock = 256;
using Block = Eigen::Array<float, kBlock, 1>;

// Coordinates of vertices and normals by axis, for vectorized arithmetic; padded to whole blocks with zeros, because a
// zero normal faces no view.
struct VertexArrays {
  std::array<Eigen::ArrayXf, 3> vertex, normal;
  Eigen::Index blocks;

  explicit VertexArrays(const Mesh& mesh)
      : blocks((static_cast<Eigen::Index>(mesh.vertices.size()) + kBlock - 1) / kBlock) {
    for (int axis = 0; axis < 3; ++axis) {
      vertex[axis] = Eigen::ArrayXf::Zero(blocks * kBlock);
      normal[axis] = Eigen::ArrayXf::Zero(blocks * kBlock);
      for (size_t i = 0; i < mesh.vertices.size(); ++i) {
        vertex[axis][static_cast<Eigen::Index>(i)] = mesh.vertices[i][axis];
        normal[axis][static_cast<Eigen::Index>(i)] = mesh.normals[i][axis];
      }
    }
  }
};

// The vertices that face a view, in the order of the mesh.
struct FacingVertices {
  size_t count = 0;
  std::vector<uint32_t> vertex;
  std::vector<float> depth_mu, cosine, u_px, v_px;  // pixels of the full image
  float nearest_mu;
  Eigen::Vector2f min_px, max_px;

  explicit FacingVertices(size_t capacity)
      : vertex(capacity), depth_mu(capacity), cosine(capacity), u_px(capacity), v_px(capacity) {}

  void Collect(const VertexArrays& arrays, const TrainingCamera& view) {
    const Eigen::Matrix3f R = view.T_camera_object.RotationMatrix().cast<float>();
    const Eigen::Vector3f t = view.T_camera_object.translation().cast<float>();
    const Eigen::Vector3f center = -(R.transpose() * t);
    const float fx_px = static_cast<float>(view.camera.fx_px), fy_px = static_cast<float>(view.camera.fy_px);
    const float cx_px = static_cast<float>(view.camera.cx_px), cy_px = static_cast<float>(view.camera.cy_px);
    count = 0;
    for (Eigen::Index block = 0; block < arrays.blocks; ++block) {
      const auto of = [&](const Eigen::ArrayXf& all) { return all.segment<kBlock>(block * kBlock); };
      const Block x = of(arrays.vertex[0]), y = of(arrays.vertex[1]), z = of(arrays.vertex[2]);
      const Block dx = center.x() - x, dy = center.y() - y, dz = center.z() - z;
      const Block toward = of(arrays.normal[0]) * dx + of(arrays.normal[1]) * dy + of(arrays.normal[2]) * dz;
      const Block block_cosine = toward / (dx.square() + dy.square() + dz.square()).sqrt();
      const Block depth = R(2, 0) * x + R(2, 1) * y + R(2, 2) * z + t.z();
      const Block per_depth = depth.inverse();
      const Block u = (R(0, 0) * x + R(0, 1) * y + R(0, 2) * z + t.x()) * per_depth * fx_px + cx_px;
      const Block v = (R(1, 0) * x + R(1, 1) * y + R(1, 2) * z + t.y()) * per_depth * fy_px + cy_px;
      for (Eigen::Index i = 0; i < kBlock; ++i) {
        // Branchless, because a branch would be unpredictable: every vertex is written, and advancing `count` keeps it.
        vertex[count] = static_cast<uint32_t>(block * kBlock + i);
        depth_mu[count] = depth[i];
        cosine[count] = block_cosine[i];
        u_px[count] = u[i];
        v_px[count] = v[i];
        count += static_cast<size_t>((block_cosine[i] > 0) & (depth[i] > 0) & (std::abs(u[i]) < kMaxPixel) &
                                     (std::abs(v[i]) < kMaxPixel));
      }
    }
    FindBounds();
  }

 private:
  void FindBounds() {
    const auto of = [this](const std::vector<float>& all) {
      return Eigen::Map<const Eigen::ArrayXf>(all.data(), static_cast<Eigen::Index>(count));
    };
    if (count == 0) return;
    nearest_mu = of(depth_mu).minCoeff();
    min_px = {of(u_px).minCoeff(), of(v_px).minCoeff()};
    max_px = {of(u_px).maxCoeff(), of(v_px).maxCoeff()};
  }
};

// The smallest depth in each bin of a view's image; a bin is about two cells of the mesh wide.
class DepthBuffer {
 public:
  DepthBuffer(const FacingVertices& facing, float bin_px)
      : min_px_(facing.min_px), per_px_(1.0f / bin_px), bin_(facing.count) {
    const Eigen::Vector2f size = (facing.max_px - min_px_) * per_px_;
    const int width = std::min(static_cast<int>(size.x()), kMaxSide - 1) + 1;
    const int height = std::min(static_cast<int>(size.y()), kMaxSide - 1) + 1;
    nearest_mu_.assign(static_cast<size_t>(width) * static_cast<size_t>(height),
                       std::numeric_limits<float>::infinity());
    for (size_t i = 0; i < facing.count; ++i) {
      const int x = std::min(static_cast<int>((facing.u_px[i] - min_px_.x()) * per_px_), width - 1);
      const int y = std::min(static_cast<int>((facing.v_px[i] - min_px_.y()) * per_px_), height - 1);
      bin_[i] = static_cast<uint32_t>(y * width + x);
      float& nearest = nearest_mu_[bin_[i]];
      nearest = std::min(nearest, facing.depth_mu[i]);
    }
  }

  // The smallest depth at the i-th facing vertex.
  float NearestAt(size_t i) const { return nearest_mu_[bin_[i]]; }

 private:
  Eigen::Vector2f min_px_;
  float per_px_;
  std::vector<uint32_t> bin_;  // of each facing vertex
  std::vector<float> nearest_mu_;
};

class Observation {
 public:
  Observation(const Mesh& mesh, const Eigen::Vector3f& box_half_extents, float cell_mu)
      : arrays_(mesh),
        longest_side_mu_(2.0f * box_half_extents.maxCoeff()),
        cell_mu_(cell_mu),
        facing_(static_cast<size_t>(arrays_.blocks * kBlock)) {}

  // Adds the view's weights to those of the vertices it observes.
  void Add(const TrainingCamera& view, std::vector<float>& weights) {
    const auto focal_px = static_cast<float>(std::max(view.camera.fx_px, view.camera.fy_px));
    if (!view.T_camera_object.IsFinite() || !std::isfinite(focal_px)) return;
    facing_.Collect(arrays_, view);
    if (facing_.count == 0) return;
    const DepthBuffer buffer(facing_, kBinCells * std::max(focal_px * cell_mu_ / facing_.nearest_mu, 1.0f));
    const float sharp_mu = focal_px * longest_side_mu_ / kSharpSide_px;  // within this depth a view is sharp
    for (size_t i = 0; i < facing_.count; ++i) {
      if (KindAt(view, facing_.u_px[i], facing_.v_px[i]) != RayKind::kObject || IsHidden(i, buffer)) continue;
      weights[facing_.vertex[i]] += facing_.cosine[i] * std::min(1.0f, sharp_mu / facing_.depth_mu[i]);
    }
  }

 private:
  bool IsHidden(size_t i, const DepthBuffer& buffer) const {
    const float behind_cells = (facing_.depth_mu[i] - buffer.NearestAt(i)) / cell_mu_;
    if (behind_cells <= kHiddenCells) return false;
    const float cosine = facing_.cosine[i];
    const float slope = std::sqrt(std::max(1.0f - cosine * cosine, 0.0f)) / cosine;
    return behind_cells > kHiddenCells + 2.0f * std::min(slope, kMaxSlope);
  }

  const VertexArrays arrays_;
  const float longest_side_mu_;
  const float cell_mu_;
  FacingVertices facing_;  // of the current view
};

}  // namespace

void SetConfidence(std::span<const TrainingCamera> views, const Eigen::Vector3f& box_half_extents, float cell_mu,
                   Mesh& mesh) {
  mesh.confidence.assign(mesh.vertices.size(), 0.0f);
  Observation observation(mesh, box_half_extents, cell_mu);
  const size_t used = std::min(views.size(), kMaxViews);
  if (used == 0) return;
  for (size_t i = 0; i < used; ++i) observation.Add(views[i * views.size() / used], mesh.confidence);
  const float per_weight = static_cast<float>(views.size()) / static_cast<float>(used) / kEnoughWeight;
  for (float& confidence : mesh.confidence) confidence = 1.0f - std::exp(-confidence * per_weight);
}

void TrimUnseen(float min_confidence, Mesh& mesh) {
  std::erase_if(mesh.triangles, [&](const std::array<uint32_t, 3>& triangle) {
    return std::all_of(triangle.begin(), triangle.end(),
                       [&](uint32_t v) { return mesh.confidence[v] < min_confidence; });
  });
  std::vector<uint8_t> used(mesh.vertices.size(), 0);
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t vertex : triangle) used[vertex] = 1;
  }
  std::vector<uint32_t> moved_to(mesh.vertices.size());
  uint32_t kept = 0;
  for (uint32_t vertex = 0; vertex < used.size(); ++vertex) {
    if (used[vertex] == 0) continue;
    moved_to[vertex] = kept;
    mesh.vertices[kept] = mesh.vertices[vertex];
    if (!mesh.normals.empty()) mesh.normals[kept] = mesh.normals[vertex];
    if (!mesh.colors.empty()) mesh.colors[kept] = mesh.colors[vertex];
    mesh.confidence[kept] = mesh.confidence[vertex];
    ++kept;
  }
  mesh.vertices.resize(kept);
  if (!mesh.normals.empty()) mesh.normals.resize(kept);
  if (!mesh.colors.empty()) mesh.colors.resize(kept);
  mesh.confidence.resize(kept);
  for (auto& triangle : mesh.triangles) {
    for (uint32_t& vertex : triangle) vertex = moved_to[vertex];
  }
}

}  // namespace romap::mesh
