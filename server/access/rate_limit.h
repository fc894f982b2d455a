#pragma once

#include <algorithm>
#include <chrono>
#include <mutex>

namespace romap::access {

// Limits a rate: a token bucket that holds what one second allows. Thread-safe.
class RateLimit {
 public:
  using Clock = std::chrono::steady_clock;

  // `per_second`: 0 = no limit.
  explicit RateLimit(double per_second) : per_second_(per_second), level_(per_second) {}

  // Takes an amount, and returns how long the caller must wait before it goes on; 0 within the limit. An amount larger
  // than the bucket is allowed, and paid for by the wait.
  std::chrono::nanoseconds Take(double amount, Clock::time_point now) {
    if (per_second_ <= 0) return std::chrono::nanoseconds(0);
    std::lock_guard lock(mutex_);
    const double elapsed_s = std::chrono::duration<double>(now - last_).count();
    level_ = std::min(per_second_, level_ + std::max(0.0, elapsed_s) * per_second_) - amount;
    last_ = std::max(last_, now);
    if (level_ >= 0) return std::chrono::nanoseconds(0);
    return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(-level_ / per_second_));
  }

 private:
  const double per_second_;
  std::mutex mutex_;
  double level_;  // what may be taken now; negative: what was taken too early
  Clock::time_point last_ = Clock::now();
};

}  // namespace romap::access
