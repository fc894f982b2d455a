#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "client/render/rasterizer.h"
#include "client/synth/exposure_blur.h"
#include "client/synth/image_poses.h"
#include "client/synth/scene.h"
#include "client/synth/visibility.h"
#include "common/camera_model.h"

namespace romap::synth {

// A rendered frame without faults. The images have the size of the camera image.
struct TrueFrame {
  cv::Mat color_bgr;  // CV_8UC3 sRGB, mean of 2x2 samples per pixel in linear space
  cv::Mat labels;     // CV_8UC1 label of the object at the pixel center, 0 = room
  cv::Mat depth_m;    // CV_32FC1 z depth at the pixel center [m]; 0 = nothing
};

// Renders a scene with baked light. Pixels that show no surface have the color of the background.
class FrameRenderer {
 public:
  // `scene` must outlive the renderer and not change.
  FrameRenderer(const Scene& scene, const CameraModel& camera);

  // Labels and depth are those of `poses`. The color is that of `poses` too if `exposure` is empty, otherwise the mean
  // of the images at these moments. Thread-safe.
  TrueFrame Render(const ImagePoses& poses, std::span<const ImagePoses> exposure = {}) const;

 private:
  static constexpr int kSamplesAcross = 2;
  static constexpr int kSamples = kSamplesAcross * kSamplesAcross;

  FrameRenderer(const Scene& scene, const CameraModel& camera, const std::shared_ptr<const Bvh>& bvh);
  bool SameSurface(const std::array<int32_t, kSamples>& hits) const;
  // The color at the pixel center.
  Rgb CenterColor(const render::VisibilityImage& centers, const ImagePoses& poses, int u_px, int v_px) const;
  // The mean color of the samples of a pixel.
  Rgb MeanColor(const render::VisibilityImage& fine, const ImagePoses& poses, int u_px, int v_px) const;
  std::vector<Rgb> ExposedColors(const render::VisibilityImage& centers, const ImagePoses& poses,
                                 std::span<const ImagePoses> exposure) const;
  std::vector<Rgb> SharpColors(const ImagePoses& poses) const;

  const Scene& scene_;
  const CameraModel camera_;
  const float pixel_rad_;  // tangent of the angle that a pixel covers
  const Visibility centers_;
  const Visibility fine_;
  const ExposureBlur blur_;
};

}  // namespace romap::synth
