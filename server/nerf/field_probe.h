#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/nerf/model/field_model.h"
#include "server/nerf/model/render_space.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/ray_set.h"

namespace romap::nerf {

// The difference between a rendering of the field and one view. Means over the view's probe pixels.
struct ViewResidual {
  float color = 0;    // squared color error on object pixels, 0..3
  float missing = 0;  // 1 - opacity on object pixels, 0..1
  float spilled = 0;  // opacity on background pixels, 0..1

  float Outline() const { return missing + spilled; }
};

struct ProbeReport {
  // The weighted mean over the views: color residual plus half the outline residual. 0 if all weights are 0.
  double Loss(std::span<const float> view_weights) const;

  std::vector<ViewResidual> views;
};

// Compares a field with its views on a fixed set of a few pixels per view. Because the pixels stay the same, small
// changes of the field are measurable, and single views can be compared with the others.
class FieldProbe {
 public:
  // Chooses the pixels. Call it whenever `rays`, of `views` views, was rebuilt or its cameras moved. Keeps no reference
  // to `rays`.
  void Build(const RaySet& rays, size_t views);
  // The share of the rays through object pixels that intersect the box [0, extent] of Unit space, 0..1. 1 without rays.
  double ShareIntersectingBox(const std::array<float, 3>& extent) const;
  ProbeReport Measure(const FieldModel& model, const NerfConfig& config, const RenderSpace& space) const;

 private:
  struct Source {
    uint32_t view;
    bool is_object;
  };

  size_t views_ = 0;
  std::vector<Ray> rays_;
  std::vector<Source> sources_;  // of each ray
};

}  // namespace romap::nerf
