// Opacities of signed-distance fields: memory and loops here, formulas in math/. Included like kernels-inl.h.
#include "server/nerf/cpu/kernels.h"
#include "server/nerf/math/signed_distance.h"

#if defined(ROMAP_NERF_CPU_DISTANCE_KERNELS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_CPU_DISTANCE_KERNELS_INL
#else
#define ROMAP_NERF_CPU_DISTANCE_KERNELS_INL
#endif

ROMAP_MATH_BEGIN

template <class Wide>
void PassThroughDistances(const RaySpan* spans, int ray_count, float sharpness, SampleChunk& c) {
  using L = Lane<Wide>;
  for (int i = 0; i < c.size; i += L::kLanes) {
    Wide red, green, blue, raw;
    L::Load4(c.raw.data() + kOutputs * i, red, green, blue, raw);
    L::Store(LightAtRaw(raw, L::Set(sharpness)), c.light.data() + i);
    L::Store(L::Set(1.0f), c.density.data() + i);
    L::Store(L::Set(1.0f), c.length.data() + i);
  }
  for (int r = 0; r < ray_count; ++r) {
    float before = 1;
    for (int i = spans[r].first; i < spans[r].first + spans[r].count; ++i) {
      c.alpha[i] = OpacityBetween(before, c.light[i]);
      before = c.light[i];
    }
  }
}

inline void PassThroughDistancesBackward(const RaySpan* spans, int ray_count, float sharpness, SampleChunk& c) {
  for (int r = 0; r < ray_count; ++r) {
    const int at = spans[r].first;
    float* d = c.d_raw.data() + kOutputs * at + 3;
    DistanceBackward(spans[r].count, sharpness, c.light.data() + at, c.alpha.data() + at, d, d, kOutputs);
  }
}

ROMAP_MATH_END

#endif
