#include "server/nerf/math/lane.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_ADAM) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_ADAM
#else
#define ROMAP_NERF_MATH_ADAM
#endif

ROMAP_MATH_BEGIN

// One Adam step (Kingma and Ba, 2015) on each lane whose gradient is not zero: a hash table entry that no sample
// touched must keep its moments. No bias correction: a step count shared by all entries would be wrong for rarely
// touched ones. With betas 0.8 and 0.95 the first step of an entry is 0.89 learning rates long.
template <class F>
ROMAP_HD void AdamUpdate(F gradient, const AdamRates& rates, F& parameter, F& first, F& second) {
  const F beta1 = Lane<F>::Set(rates.beta1), one_minus_beta1 = Lane<F>::Set(1.0f - rates.beta1);
  const F beta2 = Lane<F>::Set(rates.beta2), one_minus_beta2 = Lane<F>::Set(1.0f - rates.beta2);
  const F m = MulAdd(beta1, first, one_minus_beta1 * gradient);
  const F v = MulAdd(beta2, second, one_minus_beta2 * (gradient * gradient));
  const F step = Lane<F>::Set(rates.learning_rate) * m / (Sqrt(v) + Lane<F>::Set(1e-15f));
  first = Lane<F>::IfNonZero(gradient, m, first);
  second = Lane<F>::IfNonZero(gradient, v, second);
  parameter = Lane<F>::IfNonZero(gradient, parameter - step, parameter);
}

ROMAP_MATH_END

#endif
