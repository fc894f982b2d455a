#pragma once

#include <Eigen/Core>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "client/render/rasterizer.h"
#include "client/synth/bvh.h"
#include "client/synth/scene.h"
#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::synth {

// A rendered frame without faults. The images have the size of the camera image.
struct TrueFrame {
  cv::Mat color_bgr;  // CV_8UC3 sRGB, mean of 2x2 samples per pixel in linear space
  cv::Mat labels;     // CV_8UC1 label of the object at the pixel center, 0 = room
  cv::Mat depth_m;    // CV_32FC1 z depth at the pixel center [m]; 0 = nothing
};

// Renders a scene with baked light. Uses a z-buffer for a pinhole camera and ray tracing for a lens. Pixels of a lens
// that receive no rays have the color of the background.
class FrameRenderer {
 public:
  // `scene` must outlive the renderer and not change.
  FrameRenderer(const Scene& scene, const CameraModel& camera);

  // Thread-safe.
  TrueFrame Render(const SE3<World, Camera>& T_world_camera) const;

 private:
  // The visible triangle of each sample of an image. `lens_rays` is empty for a pinhole camera.
  render::VisibilityImage Visibility(const CameraModel& camera, const std::vector<Eigen::Vector2d>& lens_rays,
                                     const SE3<World, Camera>& T_world_camera) const;
  Rgb PixelColor(const render::VisibilityImage& fine, const SE3<World, Camera>& T_world_camera, int u_px,
                 int v_px) const;
  Rgb Radiance(int32_t triangle, const Eigen::Vector3d& ray_camera, const SE3<World, Camera>& T_world_camera,
               float inverse_depth, float pixel_share) const;

  const Scene& scene_;
  const CameraModel camera_;
  const CameraModel fine_camera_;  // its pixels are the samples of camera_
  // For a camera with a lens only:
  std::unique_ptr<Bvh> bvh_;
  std::vector<Eigen::Vector2d> center_rays_;
  std::vector<Eigen::Vector2d> fine_rays_;
};

}  // namespace romap::synth
