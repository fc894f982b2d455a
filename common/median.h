#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace romap {

// The middle value; of an even count the larger of the middle two. `values` must not be empty.
template <class T>
T Median(std::vector<T> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace romap
