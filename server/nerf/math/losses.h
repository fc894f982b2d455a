// The training loss of a ray: a sum of terms, each with its gradient.
//
// A term is a function of the result of compositing the ray (RayResult). It adds its value and its derivatives with
// respect to the color, the opacity, the depth error and the density of the samples to a RayLoss. Both back ends call
// LossOfRay; no kernel defines loss terms.
//
// Files to change for a new term `foo`:
//   1. server/nerf/math/loss_foo.h            new: AddFooLoss, value and gradient, as in loss_depth.h
//   2. server/nerf/math/losses.h              include it and call it in LossOfRay
//   3. server/nerf/math/loss_weights.h        its weight
//   4. server/nerf/model/step_parameters.cc   MakeLossWeights fills the weight from the configuration
//   5. server/nerf/nerf_config.h              the configuration field and its default
//   6. server/nerf/nerf_config.cc             its range and help
//   7. tests/unit/server/nerf/math/losses_test.cc   a case of the finite-difference test
//   8. deploy/server.yaml                     only if operators set it (a test compares the file with the field list)
// The gradient tests of the kernels and the comparison of CUDA with the CPU then cover the term without changes.
#include "server/nerf/math/lane.h"
#include "server/nerf/math/loss_color.h"
#include "server/nerf/math/loss_density.h"
#include "server/nerf/math/loss_depth.h"
#include "server/nerf/math/loss_opacity.h"
#include "server/nerf/math/loss_weights.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_LOSSES) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_LOSSES
#else
#define ROMAP_NERF_MATH_LOSSES
#endif

ROMAP_MATH_BEGIN

// All terms of a ray; `partner_error` [3] is the color error (ColorError) of its partner, ignored without a partner. It
// is not a pointer that may be null, because nvcc would then keep it on the stack. Terms are summed in a fixed order,
// because the order changes the last bits.
ROMAP_HD RayLoss LossOfRay(const RayResult& ray, const RayTarget& target, const LossWeights& weights, bool has_partner,
                           const float* partner_error) {
  RayLoss loss{};
  AddOpacityLoss(ray, target, weights, loss);
  AddColorLoss(ray, target, weights, has_partner, partner_error, loss);
  AddDepthLoss(ray, target, weights, loss);
  AddDensityLoss(ray, target, weights, loss);
  return loss;
}

ROMAP_MATH_END

#endif
