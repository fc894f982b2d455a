#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::render {

// Triangles in the World frame (map units), counter-clockwise seen from outside. Views: the owner keeps the arrays.
struct TriangleSoup {
  std::span<const Eigen::Vector3f> positions_world;
  std::span<const std::array<uint32_t, 3>> triangles;  // indices into positions_world
};

struct RasterOptions {
  bool cull_back_faces = false;
  double near_mu = 1e-3;  // surfaces closer than this z depth are not drawn
};

// What the camera sees through each pixel centre. Row-major, width * height entries.
struct VisibilityImage {
  static constexpr int32_t kNothing = -1;

  int width_px = 0;
  int height_px = 0;
  std::vector<int32_t> triangle;        // index into TriangleSoup::triangles, or kNothing
  std::vector<float> inverse_depth_mu;  // 1 / z depth in 1 / map units, 0 where there is nothing

  size_t Index(int u_px, int v_px) const { return static_cast<size_t>(v_px) * width_px + u_px; }
  // z depth in map units, 0 where there is nothing.
  float Depth(int u_px, int v_px) const {
    const float inverse = inverse_depth_mu[Index(u_px, v_px)];
    return inverse > 0 ? 1.0F / inverse : 0.0F;
  }
};

// Draws the triangles into a z-buffer: at every pixel the nearest one, the first in the soup where two tie. Screen
// tiles are drawn in parallel; the result does not depend on the number of threads. Triangles need no clipping,
// coverage is tested in homogeneous coordinates (Olano and Greer, "Triangle scan conversion using 2D homogeneous
// coordinates", 1997), so triangles that reach behind the camera are drawn right. `camera` must be free of distortion.
VisibilityImage Rasterize(const CameraModel& camera, const SE3<World, Camera>& T_world_camera, const TriangleSoup& soup,
                          const RasterOptions& options = {});

// The camera whose pixel centres are factor x factor samples, evenly spread, inside each pixel of `camera`: pixel
// (factor * u + i, factor * v + j) of the result lies in pixel (u, v) of `camera`.
CameraModel Supersampled(const CameraModel& camera, int factor);

// Weights of the triangle's corners at the point where the ray from `origin_world` along `direction_world` (any length)
// meets the triangle's plane; they add up to 1 and are perspective correct. Outside the triangle some are negative. A
// triangle seen edge-on gives (1, 0, 0).
Eigen::Vector3f Barycentrics(const std::array<Eigen::Vector3f, 3>& corners_world, const Eigen::Vector3d& origin_world,
                             const Eigen::Vector3d& direction_world);

}  // namespace romap::render
