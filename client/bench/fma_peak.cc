#include "client/bench/fma_peak.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>
#include <vector>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "client/bench/fma_peak.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace romap::bench::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// Runs `rounds` times ten independent multiply-adds, enough to hide the latency of two FMA units. Returns the number of
// operations; writing the result to `sink` prevents the compiler from removing them.
uint64_t RunFma(uint64_t rounds, float* sink) {
  const hn::ScalableTag<float> d;
  constexpr int kSums = 10;
  const auto factor = hn::Set(d, 0.999f), addend = hn::Set(d, 1e-3f);
  auto s0 = hn::Iota(d, 0.0f), s1 = s0, s2 = s0, s3 = s0, s4 = s0, s5 = s0, s6 = s0, s7 = s0, s8 = s0, s9 = s0;
  for (uint64_t i = 0; i < rounds; ++i) {
    s0 = hn::MulAdd(s0, factor, addend);
    s1 = hn::MulAdd(s1, factor, addend);
    s2 = hn::MulAdd(s2, factor, addend);
    s3 = hn::MulAdd(s3, factor, addend);
    s4 = hn::MulAdd(s4, factor, addend);
    s5 = hn::MulAdd(s5, factor, addend);
    s6 = hn::MulAdd(s6, factor, addend);
    s7 = hn::MulAdd(s7, factor, addend);
    s8 = hn::MulAdd(s8, factor, addend);
    s9 = hn::MulAdd(s9, factor, addend);
  }
  const auto sum = hn::Add(hn::Add(hn::Add(s0, s1), hn::Add(s2, s3)), hn::Add(hn::Add(s4, s5), hn::Add(s6, s7)));
  *sink = hn::GetLane(hn::Add(sum, hn::Add(s8, s9)));
  return rounds * kSums * 2 * hn::Lanes(d);
}

}  // namespace romap::bench::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace romap::bench {

HWY_EXPORT(RunFma);

double MeasureFmaPeakGflops(int threads, double seconds) {
  using Clock = std::chrono::steady_clock;
  // The fastest of many short runs, because slower ones were interrupted by other processes.
  std::vector<double> best(static_cast<size_t>(threads));
  std::atomic<float> keep = 0;
  {
    std::vector<std::jthread> workers;
    for (double& rate : best) {
      workers.emplace_back([&rate, &keep, seconds] {
        const Clock::time_point end =
            Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
        do {
          const Clock::time_point start = Clock::now();
          float sink = 0;
          const uint64_t operations = HWY_DYNAMIC_DISPATCH(RunFma)(20000, &sink);
          const double taken_s = std::chrono::duration<double>(Clock::now() - start).count();
          rate = std::max(rate, 1e-9 * static_cast<double>(operations) / taken_s);
          keep = sink;
        } while (Clock::now() < end);
      });
    }
  }
  double sum = 0;
  for (double rate : best) sum += rate;
  return sum;
}

}  // namespace romap::bench
#endif
