#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::render {

// A non-owning view of triangles in the World frame (map units), counter-clockwise seen from outside.
struct TriangleSoup {
  std::span<const Eigen::Vector3f> positions_world;
  std::span<const std::array<uint32_t, 3>> triangles;  // indices into positions_world
};

struct RasterOptions {
  bool cull_back_faces = false;
  double near_mu = 1e-3;  // surfaces closer than this z depth are not drawn
};

// The visible triangle at each pixel center. Row-major, width * height entries.
struct VisibilityImage {
  static constexpr int32_t kNothing = -1;

  int width_px = 0;
  int height_px = 0;
  std::vector<int32_t> triangle;        // index into TriangleSoup::triangles, or kNothing
  std::vector<float> inverse_depth_mu;  // 1 / z depth [1 / map units], 0 = background

  size_t Index(int u_px, int v_px) const { return static_cast<size_t>(v_px) * width_px + u_px; }
  // z depth [map units], 0 = background.
  float Depth(int u_px, int v_px) const {
    const float inverse = inverse_depth_mu[Index(u_px, v_px)];
    return inverse > 0 ? 1.0F / inverse : 0.0F;
  }
};

// Rasterizes triangles with a z-buffer. Each pixel gets the nearest triangle, and of triangles at the same depth the
// one with the lowest index. Screen tiles are processed in parallel; the result does not depend on the number of
// threads. Coverage is tested in homogeneous coordinates (Olano and Greer, "Triangle scan conversion using 2D
// homogeneous coordinates", 1997), so triangles that extend behind the camera need no clipping. `camera` must have no
// distortion.
VisibilityImage Rasterize(const CameraModel& camera, const SE3<World, Camera>& T_world_camera, const TriangleSoup& soup,
                          const RasterOptions& options = {});

// The camera whose pixels subdivide each pixel of `camera` into factor x factor samples: pixel (factor * u + i,
// factor * v + j) of the result is inside pixel (u, v) of `camera`.
CameraModel Supersampled(const CameraModel& camera, int factor);

// Perspective-correct barycentric coordinates of the intersection of a ray (direction of any length) with the plane of
// a triangle. They sum to 1; outside the triangle some are negative. Returns (1, 0, 0) for a triangle seen edge-on.
Eigen::Vector3f Barycentrics(const std::array<Eigen::Vector3f, 3>& corners_world, const Eigen::Vector3d& origin_world,
                             const Eigen::Vector3d& direction_world);

}  // namespace romap::render
