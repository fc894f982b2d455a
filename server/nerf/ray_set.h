#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/messages.h"
#include "server/nerf/cpu/kernels.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/training_box.h"

namespace romap {

// The pixels an object is trained on, shuffled once and then read in order (random access to the images would cost more
// than the rays themselves). Background pixels come from a band around the mask, where they say most about the shape.
// Pixels of occluders are left out.
class RaySet {
 public:
  RaySet(const NerfConfig& config, uint64_t seed) : config_(config), seed_(seed) {}

  // Replaces all pixels. Keeps no reference to the views.
  void Build(std::span<const ObjectView> views, const TrainingBox& box);
  bool empty() const { return object_.empty(); }

  // Ray `index` (0 .. rays_per_step - 1) of `step`, in Unit space. Thread-safe.
  nerf::Ray Get(uint64_t step, int index) const;

 private:
  struct Pixel {
    uint16_t view, u_px, v_px;
    std::array<uint8_t, 3> rgb;
    float z_mu;  // <= 0: unknown
  };
  struct ViewCamera {
    Eigen::Vector3f origin_unit;
    Eigen::Matrix3f R_object_camera;
    float fx_px, fy_px, cx_px, cy_px;
  };

  void CollectPixels(const ObjectView& view, uint16_t view_index, double keep_share);
  void Shuffle(std::vector<Pixel>& pixels, uint64_t salt) const;

  NerfConfig config_;
  uint64_t seed_;
  float unit_mu_ = 1;
  int background_rays_ = 0;  // per step
  int sparse_rays_ = 0;
  std::vector<ViewCamera> cameras_;
  std::vector<Pixel> object_, background_, sparse_;
};

}  // namespace romap
