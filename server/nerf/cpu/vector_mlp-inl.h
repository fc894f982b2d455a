// The output layer of the MLP with lanes over the hidden neurons. Included once per instruction set, after
// ROMAP_MATH_SIMD and vector_lane-inl.h.
#include "server/nerf/cpu/kernels.h"
#include "server/nerf/cpu/vector_lane-inl.h"
#include "server/nerf/model/field_model.h"

#if defined(ROMAP_NERF_CPU_VECTOR_MLP) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_CPU_VECTOR_MLP
#else
#define ROMAP_NERF_CPU_VECTOR_MLP
#endif

ROMAP_MATH_BEGIN

// Sum of the groups of four lanes of a vector.
template <class D>
HWY_INLINE hn::Vec<hn::FixedTag<float, 4> > AddGroups(D d, hn::VFromD<D> v) {
  if constexpr (Lane<hn::VFromD<D> >::kLanes == 4) {
    return v;
  } else {
    const hn::Half<D> half;
    return AddGroups(half, hn::LowerHalf(half, v) + hn::UpperHalf(half, v));
  }
}

// Four outputs do not fill a vector (see math/dense.h), so each output is a sum across lanes; the four sums of a sample
// share their additions.
struct OutputAcrossLanes {
  static void Run(const MlpWeights& mlp, int samples, const float* hidden, float* raw) {
    using D = hn::CappedTag<float, kMaxLanes>;
    using V = hn::VFromD<D>;
    static_assert(kOutputs == 4);
    const D d;
    const hn::RepartitionToWide<D> d_pair;
    const int n = mlp.hidden;
    const float* weights = mlp.out_weights();
    for (int s = 0; s < samples; ++s, hidden += n, raw += kOutputs) {
      V sum[kOutputs];
      const V first = hn::Load(d, hidden);
      for (int o = 0; o < kOutputs; ++o) sum[o] = first * hn::Load(d, weights + o * n);
      for (int k = Lane<V>::kLanes; k < n; k += Lane<V>::kLanes) {
        const V row = hn::Load(d, hidden + k);
        for (int o = 0; o < kOutputs; ++o) sum[o] = hn::MulAdd(row, hn::Load(d, weights + o * n + k), sum[o]);
      }
      // Groups of lanes (0, 1, 0, 1) and (2, 3, 2, 3) of the outputs, then (0, 1, 2, 3).
      const V sum01 = hn::InterleaveLower(d, sum[0], sum[1]) + hn::InterleaveUpper(d, sum[0], sum[1]);
      const V sum23 = hn::InterleaveLower(d, sum[2], sum[3]) + hn::InterleaveUpper(d, sum[2], sum[3]);
      const auto pair01 = hn::BitCast(d_pair, sum01), pair23 = hn::BitCast(d_pair, sum23);
      const V all = hn::BitCast(d, hn::InterleaveLower(d_pair, pair01, pair23)) +
                    hn::BitCast(d, hn::InterleaveUpper(d_pair, pair01, pair23));
      hn::StoreU(AddGroups(d, all), hn::FixedTag<float, 4>(), raw);
    }
  }
};

ROMAP_MATH_END

#endif
