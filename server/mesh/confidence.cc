#include "server/mesh/confidence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

namespace romap {
namespace {

// Size of the box in a view from which on that view counts as sharp, about what a field of this kind can resolve.
constexpr float kSharpSide_px = 64.0f;
// Sum of weights that brings confidence to 1 - 1/e.
constexpr float kEnoughWeight = 2.0f;
// What is so many cells in front of a vertex hides it, plus what its own surface rises over two cells; a surface that
// is grazed more flatly than this counts as rising no more.
constexpr float kHiddenCells = 1.5f;
constexpr float kMostSlope = 4.0f;
// More views than these say little more and are not asked; the weights of those that are stand for the others.
constexpr size_t kMostViews = 16;
// Beyond, a depth buffer would only be a waste: the camera is inside the object.
constexpr int kMostSide = 512;
// Pixels farther out are in no image, and numbers of theirs might overflow.
constexpr float kMostPixel = 1e6f;

// One view's picture of the vertices, in cells of about the mesh's own fineness.
class DepthBuffer {
 public:
  // Cell (0, 0) begins at `least_px`, cells are `cell_px` wide.
  DepthBuffer(const Eigen::Vector2f& least_px, const Eigen::Vector2f& most_px, float cell_px)
      : least_px_(least_px), per_px_(1.0f / cell_px) {
    const Eigen::Vector2f size = (most_px - least_px) * per_px_;
    width_ = std::min(static_cast<int>(size.x()) + 3, kMostSide);
    height_ = std::min(static_cast<int>(size.y()) + 3, kMostSide);
    depth_.assign(static_cast<size_t>(width_) * static_cast<size_t>(height_), std::numeric_limits<float>::infinity());
  }

  // A vertex covers the four cells whose middles are nearest, which leaves no gaps between neighbours.
  void Draw(const Eigen::Vector2f& pixel, float depth_mu) {
    const Eigen::Vector2f at = (pixel - least_px_) * per_px_ + Eigen::Vector2f::Constant(0.5f);
    const int x = std::clamp(static_cast<int>(at.x()), 0, width_ - 2);
    const int y = std::clamp(static_cast<int>(at.y()), 0, height_ - 2);
    float* row = &depth_[static_cast<size_t>(y * width_ + x)];
    for (float* cell : {row, row + 1, row + width_, row + width_ + 1}) *cell = std::min(*cell, depth_mu);
  }

  float At(const Eigen::Vector2f& pixel) const {
    const Eigen::Vector2f at = (pixel - least_px_) * per_px_ + Eigen::Vector2f::Constant(1.0f);
    const int x = std::clamp(static_cast<int>(at.x()), 0, width_ - 1);
    const int y = std::clamp(static_cast<int>(at.y()), 0, height_ - 1);
    return depth_[static_cast<size_t>(y * width_ + x)];
  }

 private:
  Eigen::Vector2f least_px_;
  float per_px_;
  int width_ = 0;
  int height_ = 0;
  std::vector<float> depth_;
};

// A vertex that faces a view.
struct FacingVertex {
  uint32_t vertex;
  float depth_mu;
  float cosine;
  Eigen::Vector2f pixel;  // full image
};

// Coordinates of vertices and normals by axis, for arithmetic on many at a time.
struct VertexArrays {
  std::array<Eigen::ArrayXf, 3> vertex, normal;

  explicit VertexArrays(const Mesh& mesh) {
    const auto count = static_cast<Eigen::Index>(mesh.vertices.size());
    for (int axis = 0; axis < 3; ++axis) {
      vertex[axis].resize(count);
      normal[axis].resize(count);
      for (Eigen::Index i = 0; i < count; ++i) {
        vertex[axis][i] = mesh.vertices[i][axis];
        normal[axis][i] = mesh.normals[i][axis];
      }
    }
  }
};

class Observation {
 public:
  Observation(const Mesh& mesh, const Eigen::Vector3f& box_half_extents, float cell_mu)
      : arrays_(mesh), longest_side_mu_(2.0f * box_half_extents.maxCoeff()), cell_mu_(cell_mu) {
    facing_.reserve(mesh.vertices.size());
  }

  // Adds the view's weights to those of the vertices it observes.
  void Add(const FieldView& view, std::vector<float>& weights) {
    const auto focal_px = static_cast<float>(std::max(view.camera.fx_px, view.camera.fy_px));
    CollectFacing(view);
    if (facing_.empty() || !std::isfinite(focal_px)) return;
    const DepthBuffer buffer = DrawFacing(focal_px);
    for (const FacingVertex& facing : facing_) {
      if (IsHidden(facing, buffer) || !IsOnObject(view, facing.pixel)) continue;
      const float side_px = focal_px * longest_side_mu_ / facing.depth_mu;
      weights[facing.vertex] += facing.cosine * std::min(1.0f, side_px / kSharpSide_px);
    }
  }

 private:
  void CollectFacing(const FieldView& view) {
    facing_.clear();
    if (!view.T_camera_object.IsFinite()) return;
    const Eigen::Matrix3f R = view.T_camera_object.RotationMatrix().cast<float>();
    const Eigen::Vector3f t = view.T_camera_object.translation().cast<float>();
    const Eigen::Vector3f center = -(R.transpose() * t);
    const auto& [x, y, z] = arrays_.vertex;
    const auto& [nx, ny, nz] = arrays_.normal;
    cosine_ = (nx * (center.x() - x) + ny * (center.y() - y) + nz * (center.z() - z)) /
              ((center.x() - x).square() + (center.y() - y).square() + (center.z() - z).square()).sqrt();
    depth_mu_ = R(2, 0) * x + R(2, 1) * y + R(2, 2) * z + t.z();
    const auto project = [&](int row, double focal_px, double middle_px, Eigen::ArrayXf& pixel) {
      pixel = (R(row, 0) * x + R(row, 1) * y + R(row, 2) * z + t[row]) / depth_mu_ * static_cast<float>(focal_px) +
              static_cast<float>(middle_px);
    };
    project(0, view.camera.fx_px, view.camera.cx_px, u_px_);
    project(1, view.camera.fy_px, view.camera.cy_px, v_px_);
    for (Eigen::Index i = 0; i < cosine_.size(); ++i) {
      if (!(cosine_[i] > 0 && depth_mu_[i] > 0)) continue;
      const Eigen::Vector2f pixel(u_px_[i], v_px_[i]);
      if (!(pixel.cwiseAbs().maxCoeff() < kMostPixel)) continue;
      facing_.push_back({static_cast<uint32_t>(i), depth_mu_[i], cosine_[i], pixel});
    }
  }

  DepthBuffer DrawFacing(float focal_px) const {
    Eigen::Vector2f least = facing_.front().pixel, most = least;
    float nearest_mu = facing_.front().depth_mu;
    for (const FacingVertex& facing : facing_) {
      least = least.cwiseMin(facing.pixel);
      most = most.cwiseMax(facing.pixel);
      nearest_mu = std::min(nearest_mu, facing.depth_mu);
    }
    DepthBuffer buffer(least, most, std::max(focal_px * cell_mu_ / nearest_mu, 1.0f));
    for (const FacingVertex& facing : facing_) buffer.Draw(facing.pixel, facing.depth_mu);
    return buffer;
  }

  bool IsHidden(const FacingVertex& facing, const DepthBuffer& buffer) const {
    const float behind_cells = (facing.depth_mu - buffer.At(facing.pixel)) / cell_mu_;
    if (behind_cells <= kHiddenCells) return false;
    const float slope = std::sqrt(std::max(1.0f - facing.cosine * facing.cosine, 0.0f)) / facing.cosine;
    return behind_cells > kHiddenCells + 2.0f * std::min(slope, kMostSlope);
  }

  static bool IsOnObject(const FieldView& view, const Eigen::Vector2f& pixel) {
    const Eigen::Vector2f in_roi = pixel - Eigen::Vector2i(view.roi_px.x, view.roi_px.y).cast<float>();
    if (!(in_roi.minCoeff() >= -0.5f)) return false;
    const int x = static_cast<int>(in_roi.x() + 0.5f);
    const int y = static_cast<int>(in_roi.y() + 0.5f);
    if (x >= view.ray_kind.cols || y >= view.ray_kind.rows) return false;
    return view.ray_kind.at<uint8_t>(y, x) == static_cast<uint8_t>(RayKind::kObject);
  }

  const VertexArrays arrays_;
  const float longest_side_mu_;
  const float cell_mu_;
  Eigen::ArrayXf cosine_, depth_mu_, u_px_, v_px_;  // of all vertices in the present view
  std::vector<FacingVertex> facing_;
};

}  // namespace

void SetConfidence(std::span<const FieldView> views, const Eigen::Vector3f& box_half_extents, float cell_mu,
                   Mesh& mesh) {
  mesh.confidence.assign(mesh.vertices.size(), 0.0f);
  Observation observation(mesh, box_half_extents, cell_mu);
  const size_t asked = std::min(views.size(), kMostViews);
  if (asked == 0) return;
  for (size_t i = 0; i < asked; ++i) observation.Add(views[i * views.size() / asked], mesh.confidence);
  const float per_weight = static_cast<float>(views.size()) / static_cast<float>(asked) / kEnoughWeight;
  for (float& confidence : mesh.confidence) confidence = 1.0f - std::exp(-confidence * per_weight);
}

void TrimUnseen(float least, Mesh& mesh) {
  std::erase_if(mesh.triangles, [&](const std::array<uint32_t, 3>& triangle) {
    return std::all_of(triangle.begin(), triangle.end(), [&](uint32_t v) { return mesh.confidence[v] < least; });
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

}  // namespace romap
