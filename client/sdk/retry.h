#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <functional>
#include <random>

namespace romap::client {

// How a client tries again after the connection to the server broke: at once, then with delays that double.
struct RetryOptions {
  std::chrono::milliseconds initial_delay{100};
  std::chrono::milliseconds max_delay{5000};
  double jitter = 0.5;  // share of a delay by which it varies at random, so that many clients do not return together
  std::chrono::milliseconds max_down{600'000};  // gives up after this time; 0: tries once
  std::function<bool()> keep_trying = {};       // false: gives up. Called often, from any thread. Empty: always true
};

// Whether an error may come from the connection, or from a server that is stopping or starting, so that the same call
// may succeed later. INTERNAL is not among them, because a fault of the server has this code, too.
bool IsBrokenLink(const absl::Status& status);

// The delays between attempts. Not thread-safe.
class RetryDelays {
 public:
  explicit RetryDelays(const RetryOptions& options);

  std::chrono::milliseconds Next();
  void Reset() { next_ = initial_; }

 private:
  const std::chrono::milliseconds initial_, max_;
  const double jitter_;
  std::chrono::milliseconds next_;
  std::mt19937 random_;
};

// Waits for `delay`, or until `deadline` if that is earlier. False, without waiting to the end, if the deadline has
// passed or options.keep_trying says so.
bool WaitToRetry(std::chrono::milliseconds delay, std::chrono::steady_clock::time_point deadline,
                 const RetryOptions& options);

inline const absl::Status& StatusOf(const absl::Status& status) { return status; }
template <class T>
const absl::Status& StatusOf(const absl::StatusOr<T>& result) {
  return result.status();
}

// Calls `call`, which returns a Status or a StatusOr, until it succeeds, fails for another reason than a broken link,
// or `options` end the attempts. Returns the last result. The call must be idempotent: a call whose answer was lost is
// made again.
template <class Call>
auto RetryWhileUnavailable(Call call, const RetryOptions& options = {}) {
  RetryDelays delays(options);
  const auto deadline = std::chrono::steady_clock::now() + options.max_down;
  while (true) {
    auto result = call();
    if (!IsBrokenLink(StatusOf(result)) || !WaitToRetry(delays.Next(), deadline, options)) return result;
  }
}

}  // namespace romap::client
