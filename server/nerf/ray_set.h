#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/stage_messages.h"
#include "server/nerf/math/types.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/pixel_sampler.h"
#include "server/nerf/training_box.h"

namespace romap::nerf {

// The training rays of an object, through the pixels that a PixelSampler chooses.
class RaySet {
 public:
  RaySet(const NerfConfig& config, uint64_t seed) : config_(config), seed_(seed), sampler_(config, seed) {}

  // Replaces all rays. Rays through pixels with consistent dense depth get a target depth. Keeps no reference to the
  // views.
  void Build(std::span<const ObjectView> views, const TrainingBox& box, const InputQuality& quality = {});
  // Updates the rays after the cameras of the same views, or the box, moved.
  void SetCameras(std::span<const ObjectView> views, const TrainingBox& box);
  bool empty() const { return sampler_.empty(); }

  // See PixelSampler.
  void Weigh(std::span<const float> views) { sampler_.Weigh(views); }
  const PixelSampler& sampler() const { return sampler_; }

  // Ray `index` (0 .. rays_per_step - 1) of `step`, in Unit space. Thread-safe.
  Ray Get(uint64_t step, int index) const;

  // The ray through any pixel of the sampler. `jitter`, 0..1, is the position of each sample in its stratum.
  Ray Through(const TrainingPixel& pixel, bool is_object, float jitter) const;

 private:
  struct ViewCamera {
    Eigen::Vector3f origin_unit;
    Eigen::Matrix3f R_object_camera;
    float fx_px, fy_px, cx_px, cy_px;
  };

  NerfConfig config_;
  uint64_t seed_;
  float unit_mu_ = 1;
  std::vector<ViewCamera> cameras_;
  PixelSampler sampler_;
};

}  // namespace romap::nerf
