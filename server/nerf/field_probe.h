#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/nerf/cpu/ray_renderer.h"
#include "server/nerf/ray_set.h"

namespace romap::nerf {

// How far what a field shows is from what a view saw, means over the view's probes.
struct ViewResidual {
  float color = 0;    // squared colour error where the view shows the object, 0..3
  float missing = 0;  // 1 - opacity where the view shows the object, 0..1
  float spilled = 0;  // opacity where the view shows background, 0..1

  // Of the shape: how far the outlines are apart.
  float Outline() const { return missing + spilled; }
};

struct ProbeReport {
  // Mean over the views of all residuals, weighted.
  double Loss(std::span<const float> view_weights) const;

  std::vector<ViewResidual> views;
};

// Looks at a field through the same few pixels of every view again and again. What it sees changes only because the
// field or its views do, so that small changes show, and single views can be judged.
class FieldProbe {
 public:
  // Chooses the pixels anew; to be called when `rays` was built anew with `views` views. Keeps no reference.
  void Build(const RaySet& rays, size_t views);
  // The part of the rays through masks that meet the box [0, extent] of Unit space, 0..1; 1 without rays.
  double ShareMeeting(const std::array<float, 3>& extent) const;
  ProbeReport Look(const nerf::FieldModel& model, const NerfConfig& config, const nerf::RenderSpace& space) const;

 private:
  struct Place {
    uint32_t view;
    bool is_object;
  };

  size_t views_ = 0;
  std::vector<nerf::Ray> rays_;
  std::vector<Place> places_;  // of each ray
};

}  // namespace romap::nerf
