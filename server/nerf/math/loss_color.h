#include "server/nerf/math/lane.h"
#include "server/nerf/math/loss_weights.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_LOSS_COLOR) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_LOSS_COLOR
#else
#define ROMAP_NERF_MATH_LOSS_COLOR
#endif

ROMAP_MATH_BEGIN

// Color loss: |e|^2 with e = rendered color - target color. A ray with a partner adds contrast |e - e'|^2, where e' is
// the color error of the partner.
//
// The contrast term penalizes errors in the difference between two nearby pixels. Light that changes slowly over a
// surface, as reflections do when the view changes, appears in both colors and cancels, so a field that does not depend
// on the view direction is less likely to represent it by dents in the surface.

// Color over which the ray is blended.
ROMAP_HD float BackgroundColor(const RayTarget& target, const LossWeights& weights, int channel) {
  return weights.random_background ? target.background[channel] : 0;
}

// Background rays are compared with a color only if there is a random one (paper: L_rr).
ROMAP_HD bool HasTargetColor(const RayTarget& target, const LossWeights& weights) {
  return target.is_object || weights.random_background;
}

// error[3]: rendered color minus target color; 0 for a ray without a target color.
ROMAP_HD void ColorError(const RayResult& ray, const RayTarget& target, const LossWeights& weights, float* error) {
  for (int c = 0; c < 3; ++c) {
    const float back = BackgroundColor(target, weights, c);
    const float wanted = target.is_object ? target.rgb[c] : back;
    error[c] = HasTargetColor(target, weights) ? ray.rgb[c] + (1 - ray.opacity) * back - wanted : 0;
  }
}

// `partner_error` [3]: see LossOfRay. Half of the contrast belongs to this ray, the other half to its partner.
ROMAP_HD void AddColorLoss(const RayResult& ray, const RayTarget& target, const LossWeights& weights, bool has_partner,
                           const float* partner_error, RayLoss& loss) {
  if (!HasTargetColor(target, weights)) return;
  float error[3];
  ColorError(ray, target, weights, error);
  for (int c = 0; c < 3; ++c) loss.color += error[c] * error[c];
  loss.value += loss.color;
  for (int c = 0; c < 3; ++c) {
    const float back = BackgroundColor(target, weights, c);
    float wanted = target.is_object ? target.rgb[c] : back;
    if (has_partner) {
      // Moving the target color makes the derivative of the square that of both terms.
      const float difference = error[c] - partner_error[c];
      wanted -= weights.contrast * difference;
      loss.value += 0.5f * weights.contrast * difference * difference;
    }
    loss.d_rgb[c] = 2 * (ray.rgb[c] + (1 - ray.opacity) * back - wanted);
    loss.d_opacity -= loss.d_rgb[c] * back;
  }
}

ROMAP_MATH_END

#endif
