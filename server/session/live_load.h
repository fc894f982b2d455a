#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>

namespace romap::session {

// The CPU time that a session needed for the inputs of a live client in the last seconds: decoding, tracking and
// mapping, not training. Thread-safe.
class LiveLoad {
 public:
  using Clock = std::chrono::steady_clock;

  void Add(double cpu_s, Clock::time_point now);
  // Mean number of cores in use. nullopt: the first input is too recent to say.
  std::optional<double> Cores(Clock::time_point now) const;

 private:
  static constexpr int kWindow_s = 10;
  static int64_t SecondOf(Clock::time_point time);

  mutable std::mutex mutex_;
  struct Second {
    int64_t second = 0;
    double cpu_s = 0;
  };
  std::array<Second, kWindow_s> seconds_{};  // by second modulo the window
  std::optional<Clock::time_point> first_;
};

}  // namespace romap::session
