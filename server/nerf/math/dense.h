#include "server/nerf/math/lane.h"

#if defined(ROMAP_NERF_MATH_DENSE) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_DENSE
#else
#define ROMAP_NERF_MATH_DENSE
#endif

ROMAP_MATH_BEGIN

// Small matrix products of the MLP. Lanes run over output neurons and a tile of R rows by C lane groups stays in
// registers, so no sum runs across lanes. With F = float and R = C = 1 this is the textbook triple loop.

enum class DenseMode {
  kLinear,       // out = a b
  kRelu,         // out = max(a b, 0)
  kMaskedByOut,  // out = out > 0 ? a b : 0; the adjoint of kRelu if out holds the result of kRelu
};

// out[R][C lane groups] = a[R][k_count] b[k_count][C lane groups]. `a_stride`: floats between rows of a; `n`: floats
// between rows of b and out.
template <class F, int R, int C, DenseMode kMode>
ROMAP_HD void DenseTile(const float* a, int a_stride, int k_count, const float* b, int n, float* out) {
  constexpr int kLanes = Lane<F>::kLanes;
  F sum[R][C];
#pragma GCC unroll 16
  for (int r = 0; r < R; ++r) {
#pragma GCC unroll 4
    for (int c = 0; c < C; ++c) sum[r][c] = Lane<F>::Zero();
  }
  for (int k = 0; k < k_count; ++k) {
    F row[C];
#pragma GCC unroll 4
    for (int c = 0; c < C; ++c) row[c] = Lane<F>::Load(b + k * n + c * kLanes);
#pragma GCC unroll 16
    for (int r = 0; r < R; ++r) {
      const F x = Lane<F>::Set(a[r * a_stride + k]);
#pragma GCC unroll 4
      for (int c = 0; c < C; ++c) sum[r][c] = MulAdd(x, row[c], sum[r][c]);
    }
  }
#pragma GCC unroll 16
  for (int r = 0; r < R; ++r) {
#pragma GCC unroll 4
    for (int c = 0; c < C; ++c) {
      float* p = out + r * n + c * kLanes;
      F value = sum[r][c];
      if constexpr (kMode == DenseMode::kRelu) value = Max(value, Lane<F>::Zero());
      if constexpr (kMode == DenseMode::kMaskedByOut) value = Lane<F>::IfPositive(Lane<F>::Load(p), value);
      Lane<F>::Store(value, p);
    }
  }
}

// The weight gradient: out[R][C lane groups] += a^T b, or out[r] += sum_s a[s][r] b[s] over `samples` rows. `a_stride`:
// floats between rows of a; `n`: floats between rows of b and out.
template <class F, int R, int C>
ROMAP_HD void OuterTile(int samples, const float* a, int a_stride, const float* b, int n, float* out) {
  constexpr int kLanes = Lane<F>::kLanes;
  F sum[R][C];
#pragma GCC unroll 16
  for (int r = 0; r < R; ++r) {
#pragma GCC unroll 4
    for (int c = 0; c < C; ++c) sum[r][c] = Lane<F>::Load(out + r * n + c * kLanes);
  }
  for (int s = 0; s < samples; ++s) {
    F row[C];
#pragma GCC unroll 4
    for (int c = 0; c < C; ++c) row[c] = Lane<F>::Load(b + s * n + c * kLanes);
#pragma GCC unroll 16
    for (int r = 0; r < R; ++r) {
      const F x = Lane<F>::Set(a[s * a_stride + r]);
#pragma GCC unroll 4
      for (int c = 0; c < C; ++c) sum[r][c] = MulAdd(x, row[c], sum[r][c]);
    }
  }
#pragma GCC unroll 16
  for (int r = 0; r < R; ++r) {
#pragma GCC unroll 4
    for (int c = 0; c < C; ++c) Lane<F>::Store(sum[r][c], out + r * n + c * kLanes);
  }
}

ROMAP_MATH_END

#endif
