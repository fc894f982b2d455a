// SSE4, AVX2, AVX-512, and plain floats for older machines.
#define HWY_DISABLED_TARGETS HWY_SSSE3
#define ROMAP_MATH_SIMD

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/nerf/cpu/simd_kernels.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "server/nerf/cpu/general_kernels-inl.h"
#if HWY_TARGET != HWY_SCALAR
#include "server/nerf/cpu/vector_encode-inl.h"
#include "server/nerf/cpu/vector_lane-inl.h"
#include "server/nerf/cpu/vector_mlp-inl.h"
#endif

HWY_BEFORE_NAMESPACE();
namespace romap::nerf::HWY_NAMESPACE {

const KernelTable& GetKernels() {
#if HWY_TARGET == HWY_SCALAR
  static const KernelTable table =
      WithGeneralKernels<float, OutputByRows, Encode, EncodeBackward>(MakeKernelTable<float, OutputByRows>("SCALAR"));
#else
  using Wide = hn::VFromD<hn::CappedTag<float, kMaxLanes> >;
  using Narrow = hn::VFromD<hn::CappedTag<float, 8> >;
  static const KernelTable table = [] {
    KernelTable made = MakeKernelTable<Wide, OutputAcrossLanes>(hwy::TargetName(HWY_TARGET));
    made.encode = EncodeLevels<Narrow, Wide>;
    made.encode_backward = EncodeLevelsBackward<Narrow, Wide>;
    return WithGeneralKernels<Wide, OutputAcrossLanes, EncodeLevels<Narrow, Wide>, EncodeLevelsBackward<Narrow, Wide> >(
        made);
  }();
#endif
  return table;
}

}  // namespace romap::nerf::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace romap::nerf {

HWY_EXPORT(GetKernels);

const KernelTable& SimdKernels() { return HWY_DYNAMIC_DISPATCH(GetKernels)(); }

}  // namespace romap::nerf
#endif
