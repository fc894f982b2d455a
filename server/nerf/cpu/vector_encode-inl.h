// The hash grid encoding and its adjoint with several levels of a point in one vector. The formulas are those of
// InterpolateCell and ScatterCell (math/hash_grid.h), which process one level at a time. Included once per instruction
// set, after ROMAP_MATH_SIMD and vector_lane-inl.h.
#include <algorithm>
#include <atomic>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/cpu/vector_lane-inl.h"
#include "server/nerf/math/hash_grid.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_CPU_VECTOR_ENCODE) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_CPU_VECTOR_ENCODE
#else
#define ROMAP_NERF_CPU_VECTOR_ENCODE
#endif

ROMAP_MATH_BEGIN

// The cells of a block of points on all levels. They are stored to memory intentionally: extracting indices from vector
// registers one by one is slower than loading them, and table loads of many points can overlap.
struct CellBlock {
  static constexpr int kPoints = 16;
  alignas(64) uint32_t pair[kPoints][4][kMaxLevels];
  alignas(64) float weight[kPoints][4][kMaxLevels];
  alignas(64) float along_x[kPoints][kMaxLevels];
};

// Fills in `count` (<= kPoints) points on all levels, padded to whole vectors V and to whole CellVectors.
template <class V>
HWY_INLINE void LocateCells(const GridLayout& layout, int count, const float* x, const float* y, const float* z,
                            CellBlock& cells) {
  using L = Lane<V>;
  for (int level = 0; level < layout.levels; level += L::kLanes) {
    const V scale = L::Load(layout.scale + level);
    const auto stride_y = L::LoadInt(layout.stride_y + level), stride_z = L::LoadInt(layout.stride_z + level);
    const auto mask = L::LoadInt(layout.mask + level), offset = L::LoadInt(layout.offset + level);
    for (int i = 0; i < count; ++i) {
      const GridCell<V> cell =
          LocateCell(L::Set(x[i]), L::Set(y[i]), L::Set(z[i]), scale, stride_y, stride_z, mask, offset);
      for (int c = 0; c < 4; ++c) {
        L::StoreInt(cell.pair[c], cells.pair[i][c] + level);
        L::Store(cell.weight[c], cells.weight[i][c] + level);
      }
      L::Store(cell.along_x, cells.along_x[i] + level);
    }
  }
  // Padding levels get weight 0.
  for (int level = layout.levels; level % L::kLanes != 0; ++level) {
    for (int i = 0; i < count; ++i) {
      for (int c = 0; c < 4; ++c) cells.weight[i][c][level] = 0.0f;
    }
  }
}

// The pairs of entries of consecutive levels, one level per group of four lanes of D.
template <class D>
HWY_INLINE hn::VFromD<D> LoadPairs(D d, const float* table, const uint32_t* pair) {
  if constexpr (Lane<hn::VFromD<D> >::kLanes == 4) {
    return hn::LoadU(d, table + 2 * static_cast<size_t>(pair[0]));
  } else {
    const hn::Half<D> half;
    constexpr int kCells = Lane<hn::VFromD<D> >::kLanes / 8;
    return hn::Combine(d, LoadPairs(half, table, pair + kCells), LoadPairs(half, table, pair));
  }
}

// Adds to these pairs one after another, because they may be identical.
template <class D>
HWY_INLINE void AddToPairs(D d, float* table, const uint32_t* pair, hn::VFromD<D> v) {
  if constexpr (Lane<hn::VFromD<D> >::kLanes == 4) {
    float* entry = table + 2 * static_cast<size_t>(pair[0]);
    hn::StoreU(hn::LoadU(d, entry) + v, d, entry);
  } else {
    const hn::Half<D> half;
    constexpr int kCells = Lane<hn::VFromD<D> >::kLanes / 8;
    AddToPairs(half, table, pair, hn::LowerHalf(half, v));
    AddToPairs(half, table, pair + kCells, hn::UpperHalf(half, v));
  }
}

// Source of each lane in a table lookup: first + from(lane).
struct LaneSources {
  template <class From>
  constexpr LaneSources(int first, const From& from) {
    for (int i = 0; i < kMaxLanes; ++i) lane[i] = first + from(i);
  }
  alignas(64) int32_t lane[kMaxLanes] = {};
};

// 2 kCells consecutive levels of one point in two vectors, four floats per level: its pair of entries (see
// math/hash_grid.h).
struct CellVectors {
  using D = hn::CappedTag<float, kMaxLanes>;
  using V = hn::VFromD<D>;
  static constexpr int kLanes = Lane<V>::kLanes;
  static constexpr int kCells = kLanes / 4;
  static constexpr int kLevels = 2 * kCells;
  V low, high;

  // Broadcasts p[k], k < kLevels, to all four floats of level k. Loads exactly these values: a load wider than the
  // preceding store defeats store forwarding and stalls.
  static HWY_INLINE CellVectors Spread(const float* p) {
    static constexpr LaneSources kLow(0, [](int i) { return i / 4; }), kHigh(kCells, [](int i) { return i / 4; });
    return Pick(hn::ZeroExtendVector(D(), hn::LoadU(hn::Half<D>(), p)), kLow, kHigh);
  }
  // Copies p[2k] and p[2k + 1] to both halves of level k.
  static HWY_INLINE CellVectors Twice(const float* p) {
    constexpr auto kFrom = [](int i) { return i / 4 * 2 + i % 2; };
    static constexpr LaneSources kLow(0, kFrom), kHigh(2 * kCells, kFrom);
    return Pick(hn::LoadU(D(), p), kLow, kHigh);
  }
  static HWY_INLINE CellVectors Load(const float* table, const uint32_t* pair) {
    return {LoadPairs(D(), table, pair), LoadPairs(D(), table, pair + kCells)};
  }
  HWY_INLINE void AddTo(float* table, const uint32_t* pair) const {
    AddToPairs(D(), table, pair, low);
    AddToPairs(D(), table, pair + kCells, high);
  }
  HWY_INLINE CellVectors Times(const CellVectors& o) const { return {low * o.low, high * o.high}; }
  // *this + a b
  HWY_INLINE CellVectors Plus(const CellVectors& a, const CellVectors& b) const {
    return {hn::MulAdd(a.low, b.low, low), hn::MulAdd(a.high, b.high, high)};
  }
  // Multiplies the lower half of each level by 1 - s, the upper half by s.
  HWY_INLINE CellVectors TimesBlend(const CellVectors& s) const {
    alignas(64) static constexpr float kSign[16] = {-1, -1, 1, 1, -1, -1, 1, 1, -1, -1, 1, 1, -1, -1, 1, 1};
    alignas(64) static constexpr float kOne[16] = {1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0};
    const V sign = hn::Load(D(), kSign), one = hn::Load(D(), kOne);
    return {low * hn::MulAdd(s.low, sign, one), high * hn::MulAdd(s.high, sign, one)};
  }
  // p[2k], p[2k + 1] = lower half + (upper half - lower half) s of level k.
  HWY_INLINE void StoreBlend(const CellVectors& s, float* p) const {
    const hn::RepartitionToWide<D> d_pair;
    const V blend_low = hn::MulAdd(hn::Shuffle1032(low) - low, s.low, low);
    const V blend_high = hn::MulAdd(hn::Shuffle1032(high) - high, s.high, high);
    const auto lower = hn::ConcatEven(d_pair, hn::BitCast(d_pair, blend_high), hn::BitCast(d_pair, blend_low));
    hn::StoreU(hn::BitCast(D(), lower), D(), p);
  }

 private:
  static HWY_INLINE CellVectors Pick(V v, const LaneSources& low, const LaneSources& high) {
    return {hn::TableLookupLanes(v, hn::SetTableIndices(D(), low.lane)),
            hn::TableLookupLanes(v, hn::SetTableIndices(D(), high.lane))};
  }
};

// Uses the narrower vectors if they hold all levels.
template <class Narrow, class Wide>
HWY_NOINLINE void LocateBlock(const GridLayout& layout, int count, const float* x, const float* y, const float* z,
                              CellBlock& cells) {
  if (layout.levels > Lane<Narrow>::kLanes) {
    LocateCells<Wide>(layout, count, x, y, z, cells);
  } else {
    LocateCells<Narrow>(layout, count, x, y, z, cells);
  }
}

template <class Narrow, class Wide>
void EncodeLevels(const GridLayout& layout, const float* table, int count, const float* x, const float* y,
                  const float* z, float* features) {
  using C = CellVectors;
  const int used = kFeaturesPerLevel * layout.levels;
  CellBlock cells;
  for (int begin = 0; begin < count; begin += CellBlock::kPoints) {
    const int n = std::min(CellBlock::kPoints, count - begin);
    LocateBlock<Narrow, Wide>(layout, n, x + begin, y + begin, z + begin, cells);
    for (int i = 0; i < n; ++i, features += layout.features) {
      for (int level = 0; level < layout.levels; level += C::kLevels) {
        // Prevents the compiler from keeping cells of several iterations in registers, which would spill.
        std::atomic_signal_fence(std::memory_order_seq_cst);
        C sum = C::Load(table, cells.pair[i][0] + level).Times(C::Spread(cells.weight[i][0] + level));
        for (int c = 1; c < 4; ++c) {
          sum = sum.Plus(C::Load(table, cells.pair[i][c] + level), C::Spread(cells.weight[i][c] + level));
        }
        sum.StoreBlend(C::Spread(cells.along_x[i] + level), features + kFeaturesPerLevel * level);
      }
      for (int f = used; f < layout.features; ++f) features[f] = 0.0f;
    }
  }
}

template <class Narrow, class Wide>
void EncodeLevelsBackward(const GridLayout& layout, int count, const float* x, const float* y, const float* z,
                          const float* d_features, float* gradient) {
  using C = CellVectors;
  CellBlock cells;
  for (int begin = 0; begin < count; begin += CellBlock::kPoints) {
    const int n = std::min(CellBlock::kPoints, count - begin);
    LocateBlock<Narrow, Wide>(layout, n, x + begin, y + begin, z + begin, cells);
    for (int i = 0; i < n; ++i, d_features += layout.features) {
      for (int level = 0; level < layout.levels; level += C::kLevels) {
        std::atomic_signal_fence(std::memory_order_seq_cst);  // as above
        const C d = C::Twice(d_features + kFeaturesPerLevel * level).TimesBlend(C::Spread(cells.along_x[i] + level));
        for (int c = 0; c < 4; ++c) {
          d.Times(C::Spread(cells.weight[i][c] + level)).AddTo(gradient, cells.pair[i][c] + level);
        }
      }
    }
  }
}

ROMAP_MATH_END

#endif
