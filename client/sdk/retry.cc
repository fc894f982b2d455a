#include "client/sdk/retry.h"

#include <algorithm>
#include <thread>

namespace romap::client {

bool IsBrokenLink(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kUnavailable:
    case absl::StatusCode::kDeadlineExceeded:
    // Of a connection that breaks during a call, gRPC may report these: a reset by a proxy, and a lost stream.
    case absl::StatusCode::kCancelled:
    case absl::StatusCode::kUnknown:
      return true;
    default:
      return false;
  }
}

RetryDelays::RetryDelays(const RetryOptions& options)
    : initial_(options.initial_delay),
      max_(options.max_delay),
      jitter_(options.jitter),
      next_(initial_),
      random_(std::random_device()()) {}

std::chrono::milliseconds RetryDelays::Next() {
  const double factor = std::uniform_real_distribution<double>(1 - jitter_, 1 + jitter_)(random_);
  const auto delay = std::chrono::milliseconds(static_cast<int64_t>(factor * static_cast<double>(next_.count())));
  next_ = std::min(2 * next_, max_);
  return delay;
}

bool WaitToRetry(std::chrono::milliseconds delay, std::chrono::steady_clock::time_point deadline,
                 const RetryOptions& options) {
  constexpr std::chrono::milliseconds kPoll{20};
  const auto stop = [&] { return options.keep_trying && !options.keep_trying(); };
  auto now = std::chrono::steady_clock::now();
  if (now >= deadline) return false;
  const auto end = std::min(deadline, now + delay);
  for (; now < end; now = std::chrono::steady_clock::now()) {
    if (stop()) return false;
    std::this_thread::sleep_for(std::min<std::chrono::steady_clock::duration>(kPoll, end - now));
  }
  return !stop();
}

}  // namespace romap::client
