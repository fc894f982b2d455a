#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "client/render/rasterizer.h"
#include "client/synth/bvh.h"
#include "client/synth/image_poses.h"
#include "client/synth/scene.h"
#include "common/camera_model.h"

namespace romap::synth {

// Finds the visible triangle of each sample of an image, with samples_across x samples_across samples per pixel. Uses a
// z-buffer for a pinhole camera and ray tracing for a lens.
class Visibility {
 public:
  // `scene` must outlive this object and not change. `bvh` contains its triangles; may be null for a pinhole camera.
  Visibility(const Scene& scene, const CameraModel& camera, int samples_across, std::shared_ptr<const Bvh> bvh);

  // Thread-safe.
  render::VisibilityImage Find(const ImagePoses& poses) const;

  // Direction of a sample in the camera frame, with z = 1; NaN if the lens receives no ray there.
  Eigen::Vector3d Ray(int u_sample, int v_sample) const;
  // Row of a sample in pixels of `camera`.
  double Row_px(int v_sample) const;

 private:
  render::VisibilityImage Rasterize(const ImagePoses& poses) const;
  render::VisibilityImage Trace(const ImagePoses& poses) const;

  const Scene& scene_;
  int samples_across_;
  CameraModel camera_;  // its pixels are the samples
  std::shared_ptr<const Bvh> bvh_;
  std::vector<Eigen::Vector2d> lens_rays_;  // empty for a pinhole camera
};

}  // namespace romap::synth
