#include "tests/bench/machine_limits.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <limits>
#include <vector>

#include "client/bench/fma_peak.h"

#define HWY_DISABLED_TARGETS HWY_SSSE3
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tests/bench/machine_limits.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace romap::measure::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Sum of the four floats at each of `count` positions; `count` is a multiple of 4.
float LoadAt(const float* table, const uint32_t* positions, size_t count) {
  const hn::CappedTag<float, 4> d;
  auto s0 = hn::Zero(d), s1 = s0, s2 = s0, s3 = s0;  // so that additions are independent
  for (size_t i = 0; i < count; i += 4) {
    s0 = s0 + hn::LoadU(d, table + positions[i]);
    s1 = s1 + hn::LoadU(d, table + positions[i + 1]);
    s2 = s2 + hn::LoadU(d, table + positions[i + 2]);
    s3 = s3 + hn::LoadU(d, table + positions[i + 3]);
  }
  return hn::GetLane(s0 + s1 + s2 + s3);
}

void UpdateAt(float* table, const uint32_t* positions, size_t count) {
  const hn::CappedTag<float, 4> d;
  const auto summand = hn::Set(d, 1e-9f);
  for (size_t i = 0; i < count; ++i) {
    float* at = table + positions[i];
    hn::StoreU(hn::LoadU(d, at) + summand, d, at);
  }
}

void UpdateAll(float* array, size_t count) {
  const hn::CappedTag<float, 16> d;
  const auto summand = hn::Set(d, 1e-9f);
  for (size_t i = 0; i < count; i += hn::Lanes(d)) hn::StoreU(hn::LoadU(d, array + i) + summand, d, array + i);
}

}  // namespace romap::measure::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace romap::measure {

HWY_EXPORT(LoadAt);
HWY_EXPORT(UpdateAt);
HWY_EXPORT(UpdateAll);

namespace {

constexpr int kRepeats = 12;
constexpr size_t kFloatsPerAccess = 4;  // 16 bytes
constexpr size_t kMaxLanes = 16;

volatile float g_sink;

double Now_s() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

// Shortest time of several calls, which excludes interruptions by other processes.
template <class Work>
double ShortestSeconds(const Work& work) {
  double best_s = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kRepeats; ++i) {
    const double start_s = Now_s();
    work();
    best_s = std::min(best_s, Now_s() - start_s);
  }
  return best_s;
}

// Calls access(table, positions) for batches of random positions in a table and returns the time per access. The
// positions are in the L1 cache.
template <class Access>
double RandomAccessSeconds(size_t table_bytes, const Access& access) {
  const size_t pairs = table_bytes / 8;  // accesses start at even floats, like those of the hash grid
  constexpr size_t kBatch = 2048;
  constexpr int kBatches = 64;
  std::vector<float> table(2 * pairs + kFloatsPerAccess);
  std::vector<uint32_t> positions(kBatch);
  uint64_t state = 88172645463325252ull;
  double best_s = std::numeric_limits<double>::infinity();
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    double spent_s = 0;
    for (int batch = 0; batch < kBatches; ++batch) {
      for (uint32_t& position : positions) {
        state = state * 6364136223846793005ull + 1442695040888963407ull;
        position = static_cast<uint32_t>(2 * ((state >> 32) * pairs >> 32));
      }
      const double start_s = Now_s();
      access(table.data(), positions);
      spent_s += Now_s() - start_s;
    }
    best_s = std::min(best_s, spent_s / (kBatch * kBatches));
  }
  return best_s;
}

}  // namespace

double PeakFlopPerSecond() { return 1e9 * bench::MeasureFmaPeakGflops(1); }

double RandomLoadSeconds(size_t table_bytes) {
  return RandomAccessSeconds(table_bytes, [](const float* table, const std::vector<uint32_t>& positions) {
    g_sink = HWY_DYNAMIC_DISPATCH(LoadAt)(table, positions.data(), positions.size());
  });
}

double RandomUpdateSeconds(size_t table_bytes) {
  return RandomAccessSeconds(table_bytes, [](float* table, const std::vector<uint32_t>& positions) {
    HWY_DYNAMIC_DISPATCH(UpdateAt)(table, positions.data(), positions.size());
  });
}

double StreamBytesPerSecond(size_t array_bytes) {
  std::vector<float> array(array_bytes / sizeof(float) / kMaxLanes * kMaxLanes);
  constexpr int kPasses = 8;
  const double seconds = ShortestSeconds([&] {
    for (int pass = 0; pass < kPasses; ++pass) HWY_DYNAMIC_DISPATCH(UpdateAll)(array.data(), array.size());
  });
  return 2.0 * kPasses * static_cast<double>(array_bytes) / seconds;
}

}  // namespace romap::measure
#endif
