#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace romap {

// Quantiles by partial sorting. `values` must not be empty, and no value may be NaN; `share` is in 0..1. The functions
// differ only if `share` falls between two values.

// The value at `rank` in ascending order; rank 0 is the smallest.
template <class T>
T OrderStatistic(std::vector<T> values, size_t rank) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// The middle value; of an even count the larger of the middle two.
template <class T>
T Median(std::vector<T> values) {
  const size_t rank = values.size() / 2;
  return OrderStatistic(std::move(values), rank);
}

// The lower of the two values.
template <class T>
T LowerQuantile(std::vector<T> values, double share) {
  const auto rank = static_cast<size_t>(share * static_cast<double>(values.size() - 1));
  return OrderStatistic(std::move(values), rank);
}

// The nearer of the two values.
template <class T>
T NearestQuantile(std::vector<T> values, double share) {
  const auto rank = static_cast<size_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  return OrderStatistic(std::move(values), rank);
}

// Linear interpolation between the two values.
inline double Quantile(std::vector<double> values, double share) {
  const double position = share * static_cast<double>(values.size() - 1);
  const auto low = values.begin() + static_cast<std::ptrdiff_t>(position);
  std::nth_element(values.begin(), low, values.end());
  if (low + 1 == values.end()) return *low;
  const double next = *std::min_element(low + 1, values.end());
  return *low + (position - std::floor(position)) * (next - *low);
}

}  // namespace romap
