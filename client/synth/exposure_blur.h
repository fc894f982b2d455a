#pragma once

#include <memory>
#include <span>
#include <vector>

#include "client/render/rasterizer.h"
#include "client/synth/bvh.h"
#include "client/synth/image_poses.h"
#include "client/synth/material.h"
#include "client/synth/scene.h"
#include "client/synth/visibility.h"
#include "common/camera_model.h"

namespace romap::synth {

// An image without motion blur: the linear color and the visible triangle at each pixel center.
struct SharpImage {
  const ImagePoses& poses;
  const render::VisibilityImage& centers;
  const std::vector<Rgb>& colors;  // row-major
};

// Simulates the motion blur of an exposure: the mean of images at several moments. Each of these images has its own
// visibility, but takes colors from the sharp image where that shows the same surface point, because evaluating
// textures takes most of the time of rendering.
class ExposureBlur {
 public:
  // As Visibility.
  ExposureBlur(const Scene& scene, const CameraModel& camera, std::shared_ptr<const Bvh> bvh);

  // Linear colors, row-major. Thread-safe.
  std::vector<Rgb> Average(const SharpImage& sharp, std::span<const ImagePoses> moments) const;

 private:
  void AddMoment(const SharpImage& sharp, const ImagePoses& poses, const Visibility& visibility,
                 std::vector<Rgb>& sum) const;

  const Scene& scene_;
  const CameraModel camera_;
  std::vector<Visibility> samplers_;  // used in turn; each has another sample position in the pixel
};

}  // namespace romap::synth
