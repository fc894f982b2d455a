// Opacities of signed-distance fields: memory and loops; the formulas are in math/. Included like kernels-inl.h.
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
void DistanceOpacity(const RaySpan* spans, int ray_count, float sharpness, SampleChunk& c) {
  using L = Lane<Wide>;
  for (int i = 0; i < c.size; i += L::kLanes) {
    Wide red, green, blue, raw;
    L::Load4(c.raw.data() + kOutputs * i, red, green, blue, raw);
    L::Store(TransmittanceAtRaw(raw, L::Set(sharpness)), c.transmittance.data() + i);
    L::Store(L::Set(1.0f), c.density.data() + i);
    L::Store(L::Set(1.0f), c.length.data() + i);
  }
  for (int r = 0; r < ray_count; ++r) {
    float before = 1;
    for (int i = spans[r].first; i < spans[r].first + spans[r].count; ++i) {
      c.alpha[i] = OpacityBetween(before, c.transmittance[i]);
      before = c.transmittance[i];
    }
  }
}

inline void DistanceOpacityBackward(const RaySpan* spans, int ray_count, float sharpness, SampleChunk& c) {
  for (int r = 0; r < ray_count; ++r) {
    const int at = spans[r].first;
    float* d = c.d_raw.data() + kOutputs * at + 3;
    DistanceBackward(spans[r].count, sharpness, c.transmittance.data() + at, c.alpha.data() + at, d, d, kOutputs);
  }
}

ROMAP_MATH_END

#endif
