#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace romap::files {

enum class TimeUnit { kSeconds, kMilliseconds, kMicroseconds, kNanoseconds };

// "seconds", "milliseconds", ...
std::string UnitName(TimeUnit unit);

// The unit of the timestamps of one file, in the order of its lines. Another unit than seconds needs evidence: the
// values are times since 1970 in that unit (years 2001 to 2100), or they are integers whose median step is a rate of
// 0.1 Hz to 10 kHz in that unit and not in seconds. If several units fit, the one with a rate of 1 Hz to 1 kHz is
// taken; if this does not decide either, seconds.
TimeUnit DetectTimeUnit(std::span<const std::string> timestamps);

// Parses a timestamp to nanoseconds exactly. nullopt: not a finite decimal number, or out of range.
std::optional<int64_t> ParseTimestamp(std::string_view text, TimeUnit unit);

}  // namespace romap::files
