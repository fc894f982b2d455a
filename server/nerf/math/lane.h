#include <cmath>
#include <cstdint>
#include <cstring>

#include "server/nerf/math/target.h"

#if defined(ROMAP_NERF_MATH_LANE) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_LANE
#else
#define ROMAP_NERF_MATH_LANE
#endif

ROMAP_MATH_BEGIN

// Operations that a formula needs from its lane type F, besides + - * /:
//   MulAdd(a, b, c) = a b + c, Min, Max, Abs, Sqrt, Floor, and Lane<F> for loads, stores, constants, conversions and
//   masks.
// This is the plain form with one value per lane type; cpu/vector_lane-inl.h has the same for Highway vectors.
template <class F>
struct Lane;

ROMAP_HD float MulAdd(float a, float b, float c) { return a * b + c; }
ROMAP_HD float Min(float a, float b) { return a < b ? a : b; }
ROMAP_HD float Max(float a, float b) { return a > b ? a : b; }
ROMAP_HD float Abs(float a) { return std::fabs(a); }
ROMAP_HD float Sqrt(float a) { return std::sqrt(a); }
ROMAP_HD float Floor(float a) { return std::floor(a); }

template <>
struct Lane<float> {
  using Float = float;
  using Int = uint32_t;
  static constexpr int kLanes = 1;

  static ROMAP_HD float Set(float x) { return x; }
  static ROMAP_HD Int SetInt(uint32_t x) { return x; }
  static ROMAP_HD float Zero() { return 0.0f; }
  static ROMAP_HD float Iota() { return 0.0f; }                  // 0, 1, 2... along the lanes
  static ROMAP_HD Int IotaInt(uint32_t first) { return first; }  // first, first + 1...
  static ROMAP_HD float Load(const float* p) { return *p; }
  static ROMAP_HD Int LoadInt(const uint32_t* p) { return *p; }
  static ROMAP_HD void Store(float x, float* p) { *p = x; }
  static ROMAP_HD void StoreInt(Int x, uint32_t* p) { *p = x; }
  // Reads four interleaved values per lane: p[0..3] is lane 0.
  static ROMAP_HD void Load4(const float* p, float& a, float& b, float& c, float& d) {
    a = p[0];
    b = p[1];
    c = p[2];
    d = p[3];
  }
  static ROMAP_HD float Exp(float x) { return std::exp(x); }
  // Converts an integral x, |x| < 2^22; negative values wrap modulo 2^32.
  static ROMAP_HD Int WholeToInt(float x) { return static_cast<uint32_t>(static_cast<int32_t>(x)); }
  // Index of the 32-bit word that holds bit `bit` of a bit array.
  static ROMAP_HD Int WordOfBit(Int bit) { return bit >> 5; }
  static ROMAP_HD Int Gather(const uint32_t* table, Int index) { return table[index]; }
  static ROMAP_HD float Gather(const float* table, Int index) { return table[index]; }
  // Stores the lanes of `x` whose bit `bit & 31` is set in `word`, compacted, and returns their number. May write a
  // whole vector.
  static ROMAP_HD int StoreWhereBit(float x, Int word, Int bit, float* to) {
    *to = x;
    return static_cast<int>((word >> (bit & 31u)) & 1u);
  }
  // Like StoreWhereBit, but stores the lanes with a > b.
  static ROMAP_HD int StoreWhereGreater(float a, float b, Int x, uint32_t* to) {
    *to = x;
    return a > b ? 1 : 0;
  }
  // The first `count` lanes of x, 0 in the other lanes.
  static ROMAP_HD float FirstLanes(int count, float x) { return count > 0 ? x : 0.0f; }
  static ROMAP_HD bool AllZero(float x) { return x == 0.0f; }
  // Per lane: test != 0 ? yes : no.
  static ROMAP_HD float IfNonZero(float test, float yes, float no) { return test != 0.0f ? yes : no; }
  // Per lane: test > 0 ? yes : 0.
  static ROMAP_HD float IfPositive(float test, float yes) { return test > 0.0f ? yes : 0.0f; }
};

// Four floats: two adjacent grid entries of two features each (see hash_grid.h).
struct Quad {
  float v[4];
  static ROMAP_HD Quad Load(const float* p) { return {{p[0], p[1], p[2], p[3]}}; }
  ROMAP_HD void Store(float* p) const {
    for (int i = 0; i < 4; ++i) p[i] = v[i];
  }
  // (p[0], p[1], p[0], p[1]) and (a, a, b, b).
  static ROMAP_HD Quad Twice(const float* p) { return {{p[0], p[1], p[0], p[1]}}; }
  static ROMAP_HD Quad Halves(float a, float b) { return {{a, a, b, b}}; }
  ROMAP_HD Quad Times(float s) const { return {{v[0] * s, v[1] * s, v[2] * s, v[3] * s}}; }
  ROMAP_HD Quad Times(const Quad& o) const { return {{v[0] * o.v[0], v[1] * o.v[1], v[2] * o.v[2], v[3] * o.v[3]}}; }
  // *this + o * s
  ROMAP_HD Quad Plus(const Quad& o, float s) const {
    return {{v[0] + o.v[0] * s, v[1] + o.v[1] * s, v[2] + o.v[2] * s, v[3] + o.v[3] * s}};
  }
  // p[0..1] = first half + (second half - first half) * s
  ROMAP_HD void StoreBlend(float s, float* p) const {
    p[0] = v[0] + (v[2] - v[0]) * s;
    p[1] = v[1] + (v[3] - v[1]) * s;
  }
};

ROMAP_MATH_END

#endif
