#include "server/nerf/math/lane.h"

#if defined(ROMAP_NERF_MATH_FREQUENCY) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_FREQUENCY
#else
#define ROMAP_NERF_MATH_FREQUENCY
#endif

ROMAP_MATH_BEGIN

// Frequency encoding (Mildenhall et al., "NeRF", 2020, eq. 4): sin and cos of 2^k pi x for each coordinate and octave
// k.

// sin(pi (u + phase)), error about 1e-6. `phase` is 0 (sine) or 1/2 (cosine). It is added after u is reduced to one
// period, so that high octaves lose no precision.
template <class F>
ROMAP_HD F SinPi(F u, F phase) {
  const F half = Lane<F>::Set(0.5f), two = Lane<F>::Set(2.0f);
  const F r = u - two * Floor(u * half) + phase;
  const F nearest = Floor(r + half);
  const F odd = nearest - two * Floor(nearest * half);  // 0 or 1: sin(pi (n + f)) = (-1)^n sin(pi f)
  const F a = Lane<F>::Set(3.14159265f) * (r - nearest);
  const F square = a * a;
  F series = Lane<F>::Set(-2.50521084e-8f);  // Taylor series up to a^11, |a| <= pi / 2
  series = MulAdd(series, square, Lane<F>::Set(2.75573192e-6f));
  series = MulAdd(series, square, Lane<F>::Set(-1.98412698e-4f));
  series = MulAdd(series, square, Lane<F>::Set(8.33333333e-3f));
  series = MulAdd(series, square, Lane<F>::Set(-1.66666667e-1f));
  series = MulAdd(series, square, Lane<F>::Set(1.0f));
  return (Lane<F>::Set(1.0f) - two * odd) * (a * series);
}

// One feature per lane: a wave along one axis. `wave_*`: 2^k for the axis of the feature, 0 for the other axes.
template <class F>
ROMAP_HD F FrequencyFeature(F wave_x, F wave_y, F wave_z, F phase, F x, F y, F z) {
  return SinPi(MulAdd(wave_x, x, MulAdd(wave_y, y, wave_z * z)), phase);
}

ROMAP_MATH_END

#endif
