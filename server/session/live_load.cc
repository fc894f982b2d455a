#include "server/session/live_load.h"

#include <algorithm>

namespace romap::session {
namespace {

constexpr double kMinMeasured_s = 3;

}  // namespace

int64_t LiveLoad::SecondOf(Clock::time_point time) {
  return std::chrono::duration_cast<std::chrono::seconds>(time.time_since_epoch()).count();
}

void LiveLoad::Add(double cpu_s, Clock::time_point now) {
  std::lock_guard lock(mutex_);
  if (!first_) first_ = now;
  Second& second = seconds_[static_cast<size_t>(SecondOf(now) % kWindow_s)];
  if (second.second != SecondOf(now)) second = {.second = SecondOf(now), .cpu_s = 0};
  second.cpu_s += cpu_s;
}

std::optional<double> LiveLoad::Cores(Clock::time_point now) const {
  std::lock_guard lock(mutex_);
  if (!first_) return std::nullopt;
  const double age_s = std::chrono::duration<double>(now - *first_).count();
  if (age_s < kMinMeasured_s) return std::nullopt;
  double cpu_s = 0;
  for (const Second& second : seconds_) {
    if (second.second > SecondOf(now) - kWindow_s) cpu_s += second.cpu_s;
  }
  return cpu_s / std::min<double>(kWindow_s, age_s);
}

}  // namespace romap::session
