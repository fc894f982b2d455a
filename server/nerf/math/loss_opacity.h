#include "server/nerf/math/lane.h"
#include "server/nerf/math/loss_weights.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_LOSS_OPACITY) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_LOSS_OPACITY
#else
#define ROMAP_NERF_MATH_LOSS_OPACITY
#endif

ROMAP_MATH_BEGIN

// Opacity loss: opacity_object (1 - sum w_i) on object rays, opacity_background sum w_i on background rays. Object rays
// should end inside the box, background rays should pass through it.
ROMAP_HD void AddOpacityLoss(const RayResult& ray, const RayTarget& target, const LossWeights& weights, RayLoss& loss) {
  if (target.is_object) {
    loss.value += weights.opacity_object * (1 - ray.opacity);
    loss.d_opacity -= weights.opacity_object;
  } else {
    loss.value += weights.opacity_background * ray.opacity;
    loss.d_opacity += weights.opacity_background;
  }
}

ROMAP_MATH_END

#endif
