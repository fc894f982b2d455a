// Highway vectors as lane types of the formulas (see math/lane.h). Included once per instruction set, after
// ROMAP_MATH_SIMD and <hwy/highway.h>.
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include "server/nerf/math/lane.h"

#if defined(ROMAP_NERF_CPU_VECTOR_LANE) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_CPU_VECTOR_LANE
#else
#define ROMAP_NERF_CPU_VECTOR_LANE
#endif

ROMAP_MATH_BEGIN

namespace hn = hwy::HWY_NAMESPACE;

template <class V>
struct Lane {
  using D = hn::DFromV<V>;
  using DInt = hn::RebindToUnsigned<D>;
  using DSigned = hn::RebindToSigned<D>;
  using Int = hn::VFromD<DInt>;
  static constexpr int kLanes = static_cast<int>(hn::MaxLanes(D()));

  static HWY_INLINE V Set(float x) { return hn::Set(D(), x); }
  static HWY_INLINE Int SetInt(uint32_t x) { return hn::Set(DInt(), x); }
  static HWY_INLINE V Zero() { return hn::Zero(D()); }
  static HWY_INLINE V Iota() { return hn::Iota(D(), 0.0f); }
  static HWY_INLINE Int IotaInt(uint32_t first) { return hn::Iota(DInt(), first); }
  static HWY_INLINE V Load(const float* p) { return hn::LoadU(D(), p); }
  static HWY_INLINE Int LoadInt(const uint32_t* p) { return hn::LoadU(DInt(), p); }
  static HWY_INLINE void Store(V x, float* p) { hn::StoreU(x, D(), p); }
  static HWY_INLINE void StoreInt(Int x, uint32_t* p) { hn::StoreU(x, DInt(), p); }
  static HWY_INLINE void Load4(const float* p, V& a, V& b, V& c, V& d) { hn::LoadInterleaved4(D(), p, a, b, c, d); }
  static HWY_INLINE V Exp(V x) { return hn::Exp(D(), x); }
  static HWY_INLINE Int WholeToInt(V x) {
    // Adding 1.5 * 2^23 leaves no fractional bits and puts x into the lowest bits of the mantissa.
    return hn::BitCast(DInt(), x + hn::Set(D(), 12582912.0f)) - SetInt(0x4b400000u);
  }
  static HWY_INLINE Int WordOfBit(Int bit) { return hn::ShiftRight<5>(bit); }
  static HWY_INLINE Int Gather(const uint32_t* table, Int index) {
    return hn::GatherIndex(DInt(), table, hn::BitCast(DSigned(), index));
  }
  static HWY_INLINE V Gather(const float* table, Int index) {
    return hn::GatherIndex(D(), table, hn::BitCast(DSigned(), index));
  }
  static HWY_INLINE int StoreWhereBit(V x, Int word, Int bit, float* to) {
    const auto chosen = hn::RebindMask(D(), hn::Ne(word & hn::Shl(SetInt(1), bit & SetInt(31)), SetInt(0)));
    Store(hn::Compress(x, chosen), to);
    return static_cast<int>(hn::CountTrue(D(), chosen));
  }
  static HWY_INLINE int StoreWhereGreater(V a, V b, Int x, uint32_t* to) {
    const auto chosen = hn::RebindMask(DInt(), hn::Gt(a, b));
    StoreInt(hn::Compress(x, chosen), to);
    return static_cast<int>(hn::CountTrue(DInt(), chosen));
  }
  static HWY_INLINE V FirstLanes(int count, V x) {
    return hn::IfThenElseZero(hn::FirstN(D(), static_cast<size_t>(count)), x);
  }
  static HWY_INLINE bool AllZero(V x) { return hn::AllTrue(D(), hn::Eq(x, Zero())); }
  static HWY_INLINE V IfNonZero(V test, V yes, V no) { return hn::IfThenElse(hn::Ne(test, Zero()), yes, no); }
  static HWY_INLINE V IfPositive(V test, V yes) { return hn::IfThenElseZero(hn::Gt(test, Zero()), yes); }
};

ROMAP_MATH_END

#endif
