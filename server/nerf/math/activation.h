#include "server/nerf/math/lane.h"

#if defined(ROMAP_NERF_MATH_ACTIVATION) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_ACTIVATION
#else
#define ROMAP_NERF_MATH_ACTIVATION
#endif

ROMAP_MATH_BEGIN

// Color of a raw output: 1 / (1 + e^-raw).
template <class F>
ROMAP_HD F Sigmoid(F raw) {
  const F one = Lane<F>::Set(1.0f);
  return one / (one + Lane<F>::Exp(Lane<F>::Zero() - Max(raw, Lane<F>::Set(-80.0f))));
}

// Density per unit of length: e^raw, which is also its own derivative. Clamped to e^12, where any step is opaque; the
// backward pass does not clamp the derivative, so that a saturated sample can recover.
template <class F>
ROMAP_HD F Density(F raw) {
  return Lane<F>::Exp(Min(Max(raw, Lane<F>::Set(-80.0f)), Lane<F>::Set(12.0f)));
}

// Opacity of a step: o = 1 - exp(-sigma delta) (paper, volume rendering).
template <class F>
ROMAP_HD F StepOpacity(F density, F length) {
  return Lane<F>::Set(1.0f) - Lane<F>::Exp(Lane<F>::Zero() - density * length);
}

// Size of the derivatives of a sample with respect to its raw outputs. Samples below a threshold skip the backward
// pass.
template <class F>
ROMAP_HD F GradientSize(F d_red, F d_green, F d_blue, F d_density) {
  return Abs(d_red) + Abs(d_green) + Abs(d_blue) + Abs(d_density);
}

ROMAP_MATH_END

#endif
