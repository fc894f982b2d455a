#include "server/nerf/math/lane.h"
#include "server/nerf/math/loss_weights.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_LOSS_DEPTH) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_LOSS_DEPTH
#else
#define ROMAP_NERF_MATH_LOSS_DEPTH
#endif

ROMAP_MATH_BEGIN

// Depth loss: weight `depth` times |sum w_i (t_i - t*)| on object rays with a known depth t* (paper: L_depth). An error
// of depth_limit or more is treated as an outlier: its loss is constant and its gradient 0.
ROMAP_HD void AddDepthLoss(const RayResult& ray, const RayTarget& target, const LossWeights& weights, RayLoss& loss) {
  if (!target.is_object || target.depth < 0) return;
  const float error = std::fabs(ray.depth_error);
  loss.value += weights.depth * (error < weights.depth_limit ? error : weights.depth_limit);
  if (error < weights.depth_limit) loss.d_depth_error += ray.depth_error > 0 ? weights.depth : -weights.depth;
}

ROMAP_MATH_END

#endif
