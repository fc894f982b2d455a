#include "server/nerf/math/lane.h"
#include "server/nerf/math/loss_weights.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_LOSS_DENSITY) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_LOSS_DENSITY
#else
#define ROMAP_NERF_MATH_LOSS_DENSITY
#endif

ROMAP_MATH_BEGIN

// Density loss: weight `density` times sum sigma_i on background rays (paper: L_density).
ROMAP_HD void AddDensityLoss(const RayResult& ray, const RayTarget& target, const LossWeights& weights, RayLoss& loss) {
  if (target.is_object) return;
  loss.value += weights.density * ray.density_sum;
  loss.d_density += weights.density;
}

ROMAP_MATH_END

#endif
