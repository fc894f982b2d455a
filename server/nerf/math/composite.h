#include "server/nerf/math/lane.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_COMPOSITE) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_COMPOSITE
#else
#define ROMAP_NERF_MATH_COMPOSITE
#endif

ROMAP_MATH_BEGIN

// Volume rendering of one ray (paper: w_i = o_i prod_{j<i} (1 - o_j), C = sum w_i c_i, D = sum w_i d_i). See losses.h
// for the losses of the result.

// Renders a ray. `target_depth`: t*, < 0 if unknown. Outputs: weight[count], behind[count] (transmittance after each
// sample).
template <class F>
ROMAP_HD RayResult CompositeForward(const RaySamples& s, F target_depth, F* weight, F* behind) {
  RayResult out{};
  F transmittance = 1;
  for (int i = 0; i < s.count; ++i) {
    weight[i] = s.alpha[i] * transmittance;
    transmittance *= 1 - s.alpha[i];
    behind[i] = transmittance;
    out.opacity += weight[i];
    for (int c = 0; c < 3; ++c) out.rgb[c] += weight[i] * s.rgb[c][i];
    if (target_depth >= 0) out.depth_error += weight[i] * (s.t[i] - target_depth);
    out.density_sum += s.density[i];
  }
  return out;
}

// Adjoint of CompositeForward: d_raw[count][kOutputs] = d loss / d raw outputs (red, green, blue, density), given the
// derivatives in `loss`. With G_i = dL/dw_i: dL/dsigma_i = delta_i (T_{i+1} G_i - sum_{j>i} w_j G_j).
template <class F>
ROMAP_HD void CompositeBackward(const RaySamples& s, F target_depth, const RayLoss& loss, const F* weight,
                                const F* behind, F* d_raw) {
  F after = 0;  // sum over the later samples j of w_j G_j
  for (int i = s.count - 1; i >= 0; --i) {
    F d_weight = loss.d_opacity;
    for (int c = 0; c < 3; ++c) d_weight += loss.d_rgb[c] * s.rgb[c][i];
    if (loss.d_depth_error != 0) d_weight += loss.d_depth_error * (s.t[i] - target_depth);
    const F d_sigma = s.length[i] * (behind[i] * d_weight - after) + loss.d_density;
    after += weight[i] * d_weight;
    for (int c = 0; c < 3; ++c) {
      const F color = s.rgb[c][i];
      d_raw[kOutputs * i + c] = weight[i] * loss.d_rgb[c] * color * (1 - color);
    }
    d_raw[kOutputs * i + 3] = d_sigma * s.density[i];
  }
}

ROMAP_MATH_END

#endif
