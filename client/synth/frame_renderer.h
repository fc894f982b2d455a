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

// A frame as it truly is, images of the camera's size.
struct TrueFrame {
  cv::Mat color_bgr;  // CV_8UC3 sRGB, averaged over 2x2 samples a pixel in linear light
  cv::Mat labels;     // CV_8UC1 label of the object at the pixel's centre, 0 = room
  cv::Mat depth_m;    // CV_32FC1 z depth at the pixel's centre, metres; 0 = nothing
};

// Draws a scene whose light is baked. A pinhole's view is drawn into a z-buffer; through a lens each sample's ray is
// followed. Where a lens collects no light the image is black.
class FrameRenderer {
 public:
  // `scene` outlives the renderer and does not change.
  FrameRenderer(const Scene& scene, const CameraModel& camera);

  // Safe to call from several threads.
  TrueFrame Render(const SE3<World, Camera>& T_world_camera) const;

 private:
  // The rays of one sampling of the image and what they meet.
  render::VisibilityImage Look(const CameraModel& camera, const std::vector<Eigen::Vector2d>& lens_rays,
                               const SE3<World, Camera>& T_world_camera) const;
  Rgb PixelColor(const render::VisibilityImage& fine, const SE3<World, Camera>& T_world_camera, int u_px,
                 int v_px) const;
  Rgb Radiance(int32_t triangle, const Eigen::Vector3d& ray_camera, const SE3<World, Camera>& T_world_camera,
               float inverse_depth, float pixel_share) const;

  const Scene& scene_;
  const CameraModel camera_;
  const CameraModel fine_camera_;  // its pixels are the samples of camera_'s
  // With a lens only:
  std::unique_ptr<Bvh> bvh_;
  std::vector<Eigen::Vector2d> center_rays_;
  std::vector<Eigen::Vector2d> fine_rays_;
};

}  // namespace romap::synth
