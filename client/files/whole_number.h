#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

namespace romap::files {

// The whole number that `value` is. nullopt: it has decimals, is not finite, or is beyond 9e15, where not every whole
// number has a double. A conversion without this check is undefined for large numbers.
inline std::optional<int64_t> WholeNumber(double value) {
  if (!(std::abs(value) <= 9e15) || value != std::floor(value)) return std::nullopt;
  return static_cast<int64_t>(value);
}

// A side of an image in pixels; 0, which no image has, if `value` is not a whole number in 0..1e6.
inline int SideOf_px(double value) {
  const std::optional<int64_t> side_px = WholeNumber(value);
  return side_px && *side_px >= 0 && *side_px <= 1'000'000 ? static_cast<int>(*side_px) : 0;
}

}  // namespace romap::files
