#include "server/nerf/math/lane.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_SIGNED_DISTANCE) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_SIGNED_DISTANCE
#else
#define ROMAP_NERF_MATH_SIGNED_DISTANCE
#endif

ROMAP_MATH_BEGIN

// Fields of signed distances, in box sides, positive outside; the surface is where they are 0.
//
// A ray's light passes a place at distance d with the share Sigmoid(s d): the cumulative logistic distribution of
// Wang et al. ("NeuS", 2021), s being its sharpness. What lies between two samples takes away the share by which that
// falls, so that the weights of a ray peak where it meets the surface, and rays that leave a surface lose nothing.

// Share of light at a raw output.
template <class F>
ROMAP_HD F LightAtRaw(F raw, F sharpness) {
  const F most = Lane<F>::Set(30.0f);  // keeps ratios of shares finite
  const F exponent = Lane<F>::Set(kDistancePerRaw) * sharpness * raw;
  const F one = Lane<F>::Set(1.0f);
  return one / (one + Lane<F>::Exp(Min(Max(exponent, Lane<F>::Zero() - most), most)));
}

// Opacity of the stretch between a sample and the one before it; `before` is 1 for the first of a ray, which comes from
// outside.
template <class F>
ROMAP_HD F OpacityBetween(F before, F light) {
  return light < before ? 1 - light / before : 0;
}

// Adjoint of LightAtRaw and OpacityBetween along a ray: d_depth[i] is the loss's derivative by the optical depth
// -log(1 - opacity) of stretch i, and d_raw[i] its derivative by the raw output of sample i. Both may be the same
// array; they are `step` apart.
template <class F>
ROMAP_HD void DistanceBackward(int count, F sharpness, const F* light, const F* opacity, const F* d_depth, F* d_raw,
                               int step) {
  for (int i = 0; i < count; ++i) {
    // The depth of stretch i is log(light before it) - log(light), where that is positive.
    F d_log_light = opacity[i] > 0 ? -d_depth[i * step] : 0;
    if (i + 1 < count && opacity[i + 1] > 0) d_log_light += d_depth[(i + 1) * step];
    d_raw[i * step] = -static_cast<F>(kDistancePerRaw) * sharpness * (1 - light[i]) * d_log_light;
  }
}

// Where the shape of a field is looked at, in units of the spacing: the corners of a tetrahedron, then its centre.
ROMAP_HD float StencilOffset(int point, int axis) {
  if (point == kStencilPoints - 1) return 0.0f;
  const int bit = point == 0 ? 0 : axis != point - 1;
  return bit ? -1.0f : 1.0f;
}

// Loss on the shape of a field of distances about one place, from the distances of the stencil's points, which lie
// `spacing` box sides apart from the centre along every axis:
//   eikonal (|grad d| - 1)^2 + curvature (spacing trace of the Hessian)^2,
// the first because a distance grows by 1 per unit (Gropp et al., "Implicit Geometric Regularization", 2020), the
// second so that the surface bends only where the views ask for it. d_distance[kStencilPoints]: derivatives.
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
