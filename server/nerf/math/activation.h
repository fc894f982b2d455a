#include "server/nerf/math/lane.h"

#if defined(ROMAP_NERF_MATH_ACTIVATION) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_ACTIVATION
#else
#define ROMAP_NERF_MATH_ACTIVATION
#endif

ROMAP_MATH_BEGIN

// Colour of a raw output: 1 / (1 + e^-raw).
template <class F>
ROMAP_HD F Sigmoid(F raw) {
  const F one = Lane<F>::Set(1.0f);
  return one / (one + Lane<F>::Exp(Lane<F>::Zero() - Max(raw, Lane<F>::Set(-80.0f))));
}

// Density per unit of length: e^raw, also its own derivative. Held at e^12, where any step is opaque; the derivative is
// not cut off there, so that a saturated sample can come back.
template <class F>
ROMAP_HD F Density(F raw) {
  return Lane<F>::Exp(Min(Max(raw, Lane<F>::Set(-80.0f)), Lane<F>::Set(12.0f)));
}

// Occupancy probability of a step: o = 1 - exp(-sigma delta) (paper, volume rendering).
template <class F>
ROMAP_HD F StepOpacity(F density, F length) {
  return Lane<F>::Set(1.0f) - Lane<F>::Exp(Lane<F>::Zero() - density * length);
}

ROMAP_MATH_END

#endif
