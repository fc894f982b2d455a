#include "server/mesh/confidence.h"

#include <algorithm>
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
// Beyond, a depth buffer would only be a waste: the camera is inside the object.
constexpr int kMostSide = 512;

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

class Observation {
 public:
  Observation(const Mesh& mesh, const Eigen::Vector3f& box_half_extents, float cell_mu)
      : mesh_(mesh), longest_side_mu_(2.0f * box_half_extents.maxCoeff()), cell_mu_(cell_mu) {
    facing_.reserve(mesh.vertices.size());
  }

  // Adds the view's weights to those of the vertices it observes.
  void Add(const FieldView& view, std::vector<float>& weights) {
    const CameraModel& camera = view.camera;
    const auto focal_px = static_cast<float>(std::max(camera.fx_px, camera.fy_px));
    CollectFacing(view);
    if (facing_.empty() || !std::isfinite(focal_px)) return;
    Eigen::Vector2f least = facing_.front().pixel, most = least;
    float nearest_mu = facing_.front().depth_mu;
    for (const FacingVertex& facing : facing_) {
      least = least.cwiseMin(facing.pixel);
      most = most.cwiseMax(facing.pixel);
      nearest_mu = std::min(nearest_mu, facing.depth_mu);
    }
    DepthBuffer buffer(least, most, std::max(focal_px * cell_mu_ / nearest_mu, 1.0f));
    for (const FacingVertex& facing : facing_) buffer.Draw(facing.pixel, facing.depth_mu);
    for (const FacingVertex& facing : facing_) {
      const float slope = std::sqrt(1.0f - std::min(facing.cosine * facing.cosine, 1.0f)) / facing.cosine;
      const float tolerance_mu = cell_mu_ * (kHiddenCells + 2.0f * std::min(slope, kMostSlope));
      if (facing.depth_mu > buffer.At(facing.pixel) + tolerance_mu || !IsOnObject(view, facing.pixel)) continue;
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
    const CameraModel& camera = view.camera;
    const Eigen::Array2f focal_px = Eigen::Array2d(camera.fx_px, camera.fy_px).cast<float>();
    const Eigen::Array2f middle_px = Eigen::Array2d(camera.cx_px, camera.cy_px).cast<float>();
    for (size_t vertex = 0; vertex < mesh_.vertices.size(); ++vertex) {
      const Eigen::Vector3f sight = center - mesh_.vertices[vertex];
      const float along = sight.dot(mesh_.normals[vertex]);
      if (!(along > 0)) continue;
      const Eigen::Vector3f p = R * mesh_.vertices[vertex] + t;
      if (!(p.z() > 0)) continue;
      const Eigen::Vector2f pixel = p.head<2>().array() / p.z() * focal_px + middle_px;
      if (!(pixel.cwiseAbs().maxCoeff() < 1e6f)) continue;
      facing_.push_back({static_cast<uint32_t>(vertex), p.z(), along / sight.norm(), pixel});
    }
  }

  static bool IsOnObject(const FieldView& view, const Eigen::Vector2f& pixel) {
    const int x = static_cast<int>(std::lround(pixel.x())) - view.roi_px.x;
    const int y = static_cast<int>(std::lround(pixel.y())) - view.roi_px.y;
    if (x < 0 || y < 0 || x >= view.ray_kind.cols || y >= view.ray_kind.rows) return false;
    return view.ray_kind.at<uint8_t>(y, x) == static_cast<uint8_t>(RayKind::kObject);
  }

  const Mesh& mesh_;
  const float longest_side_mu_;
  const float cell_mu_;
  std::vector<FacingVertex> facing_;
};

}  // namespace

void SetConfidence(std::span<const FieldView> views, const Eigen::Vector3f& box_half_extents, float cell_mu,
                   Mesh& mesh) {
  mesh.confidence.assign(mesh.vertices.size(), 0.0f);
  Observation observation(mesh, box_half_extents, cell_mu);
  for (const FieldView& view : views) observation.Add(view, mesh.confidence);
  for (float& confidence : mesh.confidence) confidence = 1.0f - std::exp(-confidence / kEnoughWeight);
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
