#include "server/nerf/math/lane.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_SIGNED_DISTANCE) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_SIGNED_DISTANCE
#else
#define ROMAP_NERF_MATH_SIGNED_DISTANCE
#endif

ROMAP_MATH_BEGIN

// Fields of signed distances, in box sides, positive outside; the surface is the zero level set.
//
// The transmittance of a point at distance d is Sigmoid(s d), the cumulative logistic distribution of Wang et al.
// ("NeuS", 2021) with sharpness s. The opacity between two samples is the relative decrease of that transmittance, so
// the weights of a ray peak where it enters the surface, and a ray that leaves a surface is not attenuated.

// Transmittance at a raw output.
template <class F>
ROMAP_HD F TransmittanceAtRaw(F raw, F sharpness) {
  const F limit = Lane<F>::Set(30.0f);  // keeps ratios of transmittances finite
  const F exponent = Lane<F>::Set(kDistancePerRaw) * sharpness * raw;
  const F one = Lane<F>::Set(1.0f);
  return one / (one + Lane<F>::Exp(Min(Max(exponent, Lane<F>::Zero() - limit), limit)));
}

// Opacity between the previous sample, of transmittance `before`, and this one. The first sample of a ray has
// `before` = 1, because rays start outside.
template <class F>
ROMAP_HD F OpacityBetween(F before, F transmittance) {
  return transmittance < before ? 1 - transmittance / before : 0;
}

// Adjoint of TransmittanceAtRaw and OpacityBetween along a ray. d_depth[i]: derivative of the loss with respect to the
// optical depth -log(1 - opacity) in front of sample i; d_raw[i], out: with respect to the raw output of sample i. Both
// may be the same array; their elements are `step` apart.
template <class F>
ROMAP_HD void DistanceBackward(int count, F sharpness, const F* transmittance, const F* opacity, const F* d_depth,
                               F* d_raw, int step) {
  for (int i = 0; i < count; ++i) {
    // Optical depth i is log(transmittance before) - log(transmittance), where that is positive.
    F d_log = opacity[i] > 0 ? -d_depth[i * step] : 0;
    if (i + 1 < count && opacity[i + 1] > 0) d_log += d_depth[(i + 1) * step];
    d_raw[i * step] = -static_cast<F>(kDistancePerRaw) * sharpness * (1 - transmittance[i]) * d_log;
  }
}

// Points at which the shape of a field is evaluated, in units of the spacing: the corners of a tetrahedron, then its
// center.
ROMAP_HD float StencilOffset(int point, int axis) {
  if (point == kStencilPoints - 1) return 0.0f;
  const int bit = point == 0 ? 0 : axis != point - 1;
  return bit ? -1.0f : 1.0f;
}

// Loss on the shape of a distance field around one center, from the distances at the points of the stencil, which are
// offset from the center by `spacing` box sides along every axis:
//   eikonal (|grad d| - 1)^2 + curvature (spacing trace of the Hessian)^2.
// The first term holds because a distance grows by 1 per unit (Gropp et al., "Implicit Geometric Regularization",
// 2020); the second keeps the surface flat where the views do not require it to bend. d_distance[kStencilPoints], out:
// derivatives.
template <class F>
ROMAP_HD F ShapeLoss(const ShapeWeights& weights, F spacing, const F* distance, F* d_distance) {
  constexpr int kCorners = kStencilPoints - 1;
  F gradient[3] = {0, 0, 0}, sum = -kCorners * distance[kCorners];
  for (int p = 0; p < kCorners; ++p) {
    for (int a = 0; a < 3; ++a) gradient[a] += StencilOffset(p, a) * distance[p] / (kCorners * spacing);
    sum += distance[p];
  }
  const F norm = std::sqrt(gradient[0] * gradient[0] + gradient[1] * gradient[1] + gradient[2] * gradient[2]) +
                 static_cast<F>(1e-6);
  const F bend = sum / (2 * spacing);
  const F d_norm = 2 * weights.eikonal * (norm - 1), d_bend = weights.curvature * bend / spacing;
  for (int p = 0; p < kCorners; ++p) {
    d_distance[p] = d_bend;
    for (int a = 0; a < 3; ++a) {
      d_distance[p] += d_norm * gradient[a] / norm * StencilOffset(p, a) / (kCorners * spacing);
    }
  }
  d_distance[kCorners] = -kCorners * d_bend;
  return weights.eikonal * (norm - 1) * (norm - 1) + weights.curvature * bend * bend;
}

ROMAP_MATH_END

#endif
