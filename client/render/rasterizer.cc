#include "client/render/rasterizer.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "common/parallel_for.h"

namespace romap::render {
namespace {

constexpr int kTileSide_px = 64;

// Bounds of the pixels that a triangle may cover, inclusive; empty if u_max < u_min.
struct PixelBox {
  int u_min = 0, v_min = 0, u_max = -1, v_max = -1;
  bool Empty() const { return u_max < u_min || v_max < v_min; }
};

// value(u, v) = a * u + b * v + c over pixels.
struct PixelPlane {
  double a = 0, b = 0, c = 0;
  double At(double u_px, double v_px) const { return a * u_px + b * v_px + c; }
};

// The dot product of `normal` with the ray through a pixel, as a linear function of the pixel.
PixelPlane PlaneOverPixels(const Eigen::Vector3d& normal, const CameraModel& camera) {
  const double a = normal.x() / camera.fx_px;
  const double b = normal.y() / camera.fy_px;
  return {a, b, normal.z() - a * camera.cx_px - b * camera.cy_px};
}

class TileRasterizer {
 public:
  TileRasterizer(const CameraModel& camera, const SE3<World, Camera>& T_world_camera, const TriangleSoup& soup,
                 const RasterOptions& options)
      : camera_(camera), soup_(soup), options_(options) {
    TransformVertices(T_world_camera.Inverse());
    BoundTriangles();
    BinTriangles();
  }

  void Draw(VisibilityImage& image) const {
    ParallelFor(tile_begin_.size() - 1, [&](size_t tile) {
      const int u_min = static_cast<int>(tile % tiles_across_) * kTileSide_px;
      const int v_min = static_cast<int>(tile / tiles_across_) * kTileSide_px;
      const PixelBox tile_box{u_min, v_min, std::min(u_min + kTileSide_px, camera_.width_px) - 1,
                              std::min(v_min + kTileSide_px, camera_.height_px) - 1};
      for (size_t i = tile_begin_[tile]; i < tile_begin_[tile + 1]; ++i) DrawTriangle(binned_[i], tile_box, image);
    });
  }

 private:
  void TransformVertices(const SE3<Camera, World>& T_camera_world) {
    const Eigen::Matrix3d rotation = T_camera_world.RotationMatrix();
    const Eigen::Vector3d translation = T_camera_world.translation();
    positions_camera_.resize(soup_.positions_world.size());
    ParallelForRanges(positions_camera_.size(), 4096, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) {
        positions_camera_[i] = rotation * soup_.positions_world[i].cast<double>() + translation;
      }
    });
  }

  void BoundTriangles() {
    boxes_.resize(soup_.triangles.size());
    ParallelForRanges(boxes_.size(), 4096, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) boxes_[i] = Bound(soup_.triangles[i]);
    });
  }

  PixelBox Bound(const std::array<uint32_t, 3>& triangle) const {
    const std::array<const Eigen::Vector3d*, 3> p = {&positions_camera_[triangle[0]], &positions_camera_[triangle[1]],
                                                     &positions_camera_[triangle[2]]};
    if (options_.cull_back_faces && p[0]->dot(p[1]->cross(*p[2])) >= 0) return {};
    // Bounds of the part beyond the near plane: its corners and the intersections of its edges with the plane.
    Eigen::AlignedBox2d bounds;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d& from = *p[k];
      const Eigen::Vector3d& to = *p[(k + 1) % 3];
      if (from.z() > options_.near_mu) bounds.extend(camera_.Project(from));
      if ((from.z() > options_.near_mu) != (to.z() > options_.near_mu)) {
        const double fraction = (options_.near_mu - from.z()) / (to.z() - from.z());
        bounds.extend(camera_.Project(from + fraction * (to - from)));
      }
    }
    // The negated condition also rejects empty and non-finite bounds.
    const double right_px = camera_.width_px - 1;
    const double bottom_px = camera_.height_px - 1;
    if (!(bounds.min().x() <= right_px && bounds.min().y() <= bottom_px && bounds.max().x() >= 0 &&
          bounds.max().y() >= 0)) {
      return {};
    }
    // Rounding errors must not exclude pixels on the border.
    constexpr double kSlack_px = 1e-6;
    return {static_cast<int>(std::ceil(std::max(bounds.min().x() - kSlack_px, 0.0))),
            static_cast<int>(std::ceil(std::max(bounds.min().y() - kSlack_px, 0.0))),
            static_cast<int>(std::floor(std::min(bounds.max().x() + kSlack_px, right_px))),
            static_cast<int>(std::floor(std::min(bounds.max().y() + kSlack_px, bottom_px)))};
  }

  template <class Visit>
  void ForEachTile(const PixelBox& box, Visit visit) const {
    if (box.Empty()) return;
    for (int row = box.v_min / kTileSide_px; row <= box.v_max / kTileSide_px; ++row) {
      for (int column = box.u_min / kTileSide_px; column <= box.u_max / kTileSide_px; ++column) {
        visit(static_cast<size_t>(row) * tiles_across_ + column);
      }
    }
  }

  // Counting sort of triangle indices by tile. Triangles of a tile stay in order, which resolves ties in depth.
  void BinTriangles() {
    tiles_across_ = (camera_.width_px + kTileSide_px - 1) / kTileSide_px;
    const int tiles_down = (camera_.height_px + kTileSide_px - 1) / kTileSide_px;
    tile_begin_.assign(static_cast<size_t>(tiles_across_) * tiles_down + 1, 0);
    for (const PixelBox& box : boxes_) {
      ForEachTile(box, [&](size_t tile) { ++tile_begin_[tile + 1]; });
    }
    for (size_t i = 1; i < tile_begin_.size(); ++i) tile_begin_[i] += tile_begin_[i - 1];
    binned_.resize(tile_begin_.back());
    std::vector<size_t> next(tile_begin_.begin(), tile_begin_.end() - 1);
    for (size_t i = 0; i < boxes_.size(); ++i) {
      ForEachTile(boxes_[i], [&](size_t tile) { binned_[next[tile]++] = static_cast<uint32_t>(i); });
    }
  }

  // With camera-frame corners p0 p1 p2 and a ray d, the plane is hit at barycentrics proportional to
  // e0 = (p1 x p2).d, e1 = (p2 x p0).d, e2 = (p0 x p1).d, at 1/z = (e0 + e1 + e2) / (p0 . p1 x p2).
  void DrawTriangle(uint32_t index, const PixelBox& tile_box, VisibilityImage& image) const {
    const std::array<uint32_t, 3>& corner = soup_.triangles[index];
    const Eigen::Vector3d& p0 = positions_camera_[corner[0]];
    const Eigen::Vector3d& p1 = positions_camera_[corner[1]];
    const Eigen::Vector3d& p2 = positions_camera_[corner[2]];
    const Eigen::Vector3d n0 = p1.cross(p2);
    const Eigen::Vector3d n1 = p2.cross(p0);
    const Eigen::Vector3d n2 = p0.cross(p1);
    const double volume = p0.dot(n0);
    if (volume == 0 || !std::isfinite(volume)) return;
    // Front faces have a negative volume, and their three e are negative inside.
    const double sign = volume < 0 ? -1 : 1;
    const PixelPlane e0 = PlaneOverPixels(sign * n0, camera_);
    const PixelPlane e1 = PlaneOverPixels(sign * n1, camera_);
    const PixelPlane e2 = PlaneOverPixels(sign * n2, camera_);
    const PixelPlane inverse_depth = PlaneOverPixels((n0 + n1 + n2) / volume, camera_);
    const double farthest_inverse = 1 / options_.near_mu;

    const PixelBox& box = boxes_[index];
    const int u_min = std::max(box.u_min, tile_box.u_min);
    const int u_max = std::min(box.u_max, tile_box.u_max);
    const int v_max = std::min(box.v_max, tile_box.v_max);
    for (int v = std::max(box.v_min, tile_box.v_min); v <= v_max; ++v) {
      const size_t row = image.Index(0, v);
      for (int u = u_min; u <= u_max; ++u) {
        if (e0.At(u, v) < 0 || e1.At(u, v) < 0 || e2.At(u, v) < 0) continue;
        const double inverse = inverse_depth.At(u, v);
        if (inverse <= 0 || inverse >= farthest_inverse) continue;
        if (static_cast<float>(inverse) <= image.inverse_depth_mu[row + u]) continue;
        image.inverse_depth_mu[row + u] = static_cast<float>(inverse);
        image.triangle[row + u] = static_cast<int32_t>(index);
      }
    }
  }

  const CameraModel& camera_;
  const TriangleSoup& soup_;
  const RasterOptions& options_;
  std::vector<Eigen::Vector3d> positions_camera_;
  std::vector<PixelBox> boxes_;  // per triangle
  int tiles_across_ = 0;
  std::vector<size_t> tile_begin_;  // start in binned_ per tile, plus the end
  std::vector<uint32_t> binned_;    // triangle indices
};

}  // namespace

VisibilityImage Rasterize(const CameraModel& camera, const SE3<World, Camera>& T_world_camera, const TriangleSoup& soup,
                          const RasterOptions& options) {
  VisibilityImage image;
  image.width_px = camera.width_px;
  image.height_px = camera.height_px;
  const size_t pixels = static_cast<size_t>(camera.width_px) * camera.height_px;
  image.triangle.assign(pixels, VisibilityImage::kNothing);
  image.inverse_depth_mu.assign(pixels, 0.0F);
  TileRasterizer(camera, T_world_camera, soup, options).Draw(image);
  return image;
}

CameraModel Supersampled(const CameraModel& camera, int factor) {
  CameraModel fine = camera;
  fine.width_px *= factor;
  fine.height_px *= factor;
  fine.fx_px *= factor;
  fine.fy_px *= factor;
  // Pixel u spans [u - 0.5, u + 0.5]; its left edge is at -0.5 in both cameras for u = 0.
  fine.cx_px = (camera.cx_px + 0.5) * factor - 0.5;
  fine.cy_px = (camera.cy_px + 0.5) * factor - 0.5;
  return fine;
}

Eigen::Vector3f Barycentrics(const std::array<Eigen::Vector3f, 3>& corners_world, const Eigen::Vector3d& origin_world,
                             const Eigen::Vector3d& direction_world) {
  const Eigen::Vector3d p0 = corners_world[0].cast<double>() - origin_world;
  const Eigen::Vector3d p1 = corners_world[1].cast<double>() - origin_world;
  const Eigen::Vector3d p2 = corners_world[2].cast<double>() - origin_world;
  const Eigen::Vector3d weights(p1.cross(p2).dot(direction_world), p2.cross(p0).dot(direction_world),
                                p0.cross(p1).dot(direction_world));
  const double sum = weights.sum();
  if (sum == 0 || !std::isfinite(sum)) return Eigen::Vector3f::UnitX();
  return (weights / sum).cast<float>();
}

}  // namespace romap::render
