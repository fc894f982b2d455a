#include "server/nerf/math/lane.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_COMPOSITE) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_COMPOSITE
#else
#define ROMAP_NERF_MATH_COMPOSITE
#endif

ROMAP_MATH_BEGIN

// Volume rendering of one ray and its losses (paper: w_i = o_i prod_{j<i} (1 - o_j), C = sum w_i c_i, D = sum w_i d_i).

// Renders the ray; weight[count] and behind[count] (transmittance after each sample) are outputs.
template <class F>
ROMAP_HD RayResult CompositeForward(const RaySamples& s, const RayTarget& target, const LossWeights& w, F* weight,
                                    F* behind) {
  RayResult out{{0, 0, 0}, 0, 0, 0, 0};
  F transmittance = 1, density_sum = 0;
  for (int i = 0; i < s.count; ++i) {
    weight[i] = s.alpha[i] * transmittance;
    transmittance *= 1 - s.alpha[i];
    behind[i] = transmittance;
    out.opacity += weight[i];
    for (int c = 0; c < 3; ++c) out.rgb[c] += weight[i] * s.rgb[c][i];
    if (target.depth >= 0) out.depth_excess += weight[i] * (s.t[i] - target.depth);
    density_sum += s.density[i];
  }
  const bool colored = target.is_object || w.random_background;
  for (int c = 0; c < 3 && colored; ++c) {
    const F back = w.random_background ? target.background[c] : 0;
    const F wanted = target.is_object ? target.rgb[c] : back;
    const F error = out.rgb[c] + (1 - out.opacity) * back - wanted;
    out.color_loss += error * error;
  }
  out.loss = out.color_loss;
  if (target.is_object) {
    out.loss += w.opacity_object * (1 - out.opacity);
    const F excess = std::fabs(out.depth_excess);
    if (target.depth >= 0) out.loss += w.depth * (excess < w.depth_limit ? excess : w.depth_limit);
  } else {
    out.loss += w.opacity_background * out.opacity + w.density * density_sum;
  }
  return out;
}

// Colour error of a rendered ray, 0 where it is to show none.
template <class F>
ROMAP_HD void ColorError(const RayResult& result, const RayTarget& target, const LossWeights& w, F* error) {
  const bool colored = target.is_object || w.random_background;
  for (int c = 0; c < 3; ++c) {
    const F back = w.random_background ? target.background[c] : 0;
    const F wanted = target.is_object ? target.rgb[c] : back;
    error[c] = colored ? result.rgb[c] + (1 - result.opacity) * back - wanted : 0;
  }
}

// The loss of contrast, w.contrast |e - e'|^2 with the colour errors e, e' of two rays through pixels near each other.
// It wants the difference of two colours right rather than the colours: light that changes slowly over a surface, as
// reflections do when the view changes, is in both and counts for less, and a field that knows no directions has less
// reason to explain it by dents. Half of it is added to result.loss, for the partner adds the other half. Returns the
// target for CompositeBackward, which is `target` moved so that the squared error of colour has the derivative of both
// losses.
template <class F>
ROMAP_HD RayTarget ContrastTarget(const RayTarget& target, const LossWeights& w, const F* error, const F* partner_error,
                                  RayResult& result) {
  RayTarget moved = target;
  for (int c = 0; c < 3; ++c) {
    const F difference = error[c] - partner_error[c];
    moved.rgb[c] -= w.contrast * difference;
    result.loss += static_cast<F>(0.5) * w.contrast * difference * difference;
  }
  return moved;
}

// Adjoint of CompositeForward: d loss / d raw outputs, d_raw[count][4] = (r, g, b, density), given the forward's
// results. With G_i = dL/dw_i: dL/dsigma_i = delta_i (T_{i+1} G_i - sum_{j>i} w_j G_j).
template <class F>
ROMAP_HD void CompositeBackward(const RaySamples& s, const RayTarget& target, const LossWeights& w,
                                const RayResult& result, const F* weight, const F* behind, F* d_raw) {
  const bool colored = target.is_object || w.random_background;
  F d_rgb[3] = {0, 0, 0}, d_opacity = target.is_object ? -w.opacity_object : w.opacity_background;
  for (int c = 0; c < 3 && colored; ++c) {
    const F back = w.random_background ? target.background[c] : 0;
    const F wanted = target.is_object ? target.rgb[c] : back;
    d_rgb[c] = 2 * (result.rgb[c] + (1 - result.opacity) * back - wanted);
    d_opacity -= d_rgb[c] * back;
  }
  F d_depth = 0;
  if (target.is_object && target.depth >= 0 && std::fabs(result.depth_excess) < w.depth_limit) {
    d_depth = result.depth_excess > 0 ? w.depth : -w.depth;
  }
  const F d_density = target.is_object ? 0 : w.density;
  F after = 0;  // sum over the samples behind of w_j G_j
  for (int i = s.count - 1; i >= 0; --i) {
    F d_weight = d_opacity;
    for (int c = 0; c < 3; ++c) d_weight += d_rgb[c] * s.rgb[c][i];
    if (d_depth != 0) d_weight += d_depth * (s.t[i] - target.depth);
    const F d_sigma = s.length[i] * (behind[i] * d_weight - after) + d_density;
    after += weight[i] * d_weight;
    for (int c = 0; c < 3; ++c) {
      const F color = s.rgb[c][i];
      d_raw[4 * i + c] = weight[i] * d_rgb[c] * color * (1 - color);
    }
    d_raw[4 * i + 3] = d_sigma * s.density[i];
  }
}

ROMAP_MATH_END

#endif
