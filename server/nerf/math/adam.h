#include "server/nerf/math/lane.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_ADAM) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_ADAM
#else
#define ROMAP_NERF_MATH_ADAM
#endif

ROMAP_MATH_BEGIN

// One Adam step (Kingma and Ba, 2015) on each lane whose gradient is not zero: an entry of the hash table that no
// sample touched must keep its moments. There is no bias correction, because a step count shared by all entries would
// be wrong for the rarely touched ones; with betas .8 and .95 an entry's first step is .89 learning rates long.
template <class F>
ROMAP_HD void AdamUpdate(F gradient, const AdamRates& rates, F& parameter, F& first, F& second) {
  const F beta1 = Lane<F>::Set(rates.beta1), rest1 = Lane<F>::Set(1.0f - rates.beta1);
  const F beta2 = Lane<F>::Set(rates.beta2), rest2 = Lane<F>::Set(1.0f - rates.beta2);
  const F m = MulAdd(beta1, first, rest1 * gradient);
  const F v = MulAdd(beta2, second, rest2 * (gradient * gradient));
  const F step = Lane<F>::Set(rates.learning_rate) * m / (Sqrt(v) + Lane<F>::Set(1e-15f));
  first = Lane<F>::IfNonZero(gradient, m, first);
  second = Lane<F>::IfNonZero(gradient, v, second);
  parameter = Lane<F>::IfNonZero(gradient, parameter - step, parameter);
}

ROMAP_MATH_END

#endif
