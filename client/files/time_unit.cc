#include "client/files/time_unit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "client/files/text_file.h"

namespace romap::files {
namespace {

constexpr std::array kUnits = {TimeUnit::kSeconds, TimeUnit::kMilliseconds, TimeUnit::kMicroseconds,
                               TimeUnit::kNanoseconds};
// The years 2001 to 2100 as seconds since 1970.
constexpr double kFirstEpoch_s = 978'307'200;
constexpr double kLastEpoch_s = 4'133'980'800;
// Larger numbers of seconds do not fit into 64-bit nanoseconds.
constexpr double kMaxSeconds = 9e9;

double PerSecond(TimeUnit unit) {
  switch (unit) {
    case TimeUnit::kSeconds:
      return 1;
    case TimeUnit::kMilliseconds:
      return 1e3;
    case TimeUnit::kMicroseconds:
      return 1e6;
    case TimeUnit::kNanoseconds:
      return 1e9;
  }
  return 1;
}

// The median of the steps between different successive values; 0 if there are none.
double MedianStep(const std::vector<double>& values) {
  std::vector<double> steps;
  for (size_t k = 1; k < values.size(); ++k) {
    if (values[k] != values[k - 1]) steps.push_back(std::abs(values[k] - values[k - 1]));
  }
  if (steps.empty()) return 0;
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  return steps[steps.size() / 2];
}

std::vector<TimeUnit> UnitsWithRate(double step, double min_hz, double max_hz) {
  std::vector<TimeUnit> units;
  for (const TimeUnit unit : kUnits) {
    const double rate_hz = PerSecond(unit) / step;
    if (rate_hz >= min_hz && rate_hz <= max_hz) units.push_back(unit);
  }
  return units;
}

}  // namespace

std::string UnitName(TimeUnit unit) {
  switch (unit) {
    case TimeUnit::kSeconds:
      return "seconds";
    case TimeUnit::kMilliseconds:
      return "milliseconds";
    case TimeUnit::kMicroseconds:
      return "microseconds";
    case TimeUnit::kNanoseconds:
      return "nanoseconds";
  }
  return "seconds";
}

TimeUnit DetectTimeUnit(std::span<const std::string> timestamps) {
  std::vector<double> values;
  bool all_integers = true;
  for (const std::string& text : timestamps) {
    const std::optional<double> value = ParseNumber(text);
    if (!value) return TimeUnit::kSeconds;  // the reader of the file reports it
    values.push_back(*value);
    all_integers &= text.find_first_of(".eE") == std::string::npos;
  }
  if (values.empty()) return TimeUnit::kSeconds;
  const auto [min, max] = std::minmax_element(values.begin(), values.end());
  const double largest = std::max(std::abs(*min), std::abs(*max));
  // Decimals are evidence of seconds, unless the values are too large for them.
  if (!all_integers && largest <= kMaxSeconds) return TimeUnit::kSeconds;

  const double step = MedianStep(values);
  std::vector<TimeUnit> plausible = step > 0 ? UnitsWithRate(step, 0.1, 1e4) : std::vector<TimeUnit>{};
  if (largest > kMaxSeconds) std::erase(plausible, TimeUnit::kSeconds);
  for (const TimeUnit unit : kUnits) {
    const bool is_epoch = *min >= kFirstEpoch_s * PerSecond(unit) && *max <= kLastEpoch_s * PerSecond(unit);
    // Nanoseconds since the start of a device are as large as milliseconds since 1970, so the step must not contradict.
    if (is_epoch && (plausible.empty() || std::ranges::count(plausible, unit) > 0)) return unit;
  }
  if (plausible.size() == 1) return plausible.front();
  if (plausible.empty() || plausible.front() == TimeUnit::kSeconds) return TimeUnit::kSeconds;
  const std::vector<TimeUnit> usual = UnitsWithRate(step, 1, 1e3);
  return usual.size() == 1 ? usual.front() : TimeUnit::kSeconds;
}

std::optional<int64_t> ParseTimestamp(std::string_view text, TimeUnit unit) {
  switch (unit) {
    case TimeUnit::kSeconds:
      return ParseSeconds(text);
    case TimeUnit::kMilliseconds:
      return ParseScaled(text, 6);
    case TimeUnit::kMicroseconds:
      return ParseScaled(text, 3);
    case TimeUnit::kNanoseconds:
      return ParseScaled(text, 0);
  }
  return std::nullopt;
}

}  // namespace romap::files
