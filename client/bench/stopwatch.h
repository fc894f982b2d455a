#pragma once

#include <time.h>

#include <chrono>

namespace romap::bench {

// The clock of the benchmark.
enum class BenchClock {
  kCpu,   // CPU time of this process divided by the number of threads: the time on an idle machine if threads never
          // waited for each other
  kWall,  // wall time
};

// Accumulates the time of work by a clock, and the wall time [s].
class Stopwatch {
 public:
  Stopwatch(BenchClock clock, int threads) : clock_(clock), threads_(threads) {}

  // Runs `work` and returns its result.
  template <class Work>
  auto Time(Work work) {
    const double start_s = Now(), wall_start_s = Wall();
    auto result = work();
    total_s_ += Now() - start_s;
    wall_s_ += Wall() - wall_start_s;
    return result;
  }

  double total_s() const { return total_s_; }
  double wall_s() const { return wall_s_; }

 private:
  static double Wall() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  }
  double Now() const {
    if (clock_ == BenchClock::kWall) return Wall();
    timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec)) / threads_;
  }

  BenchClock clock_;
  int threads_;
  double total_s_ = 0, wall_s_ = 0;
};

}  // namespace romap::bench
