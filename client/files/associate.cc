#include "client/files/associate.h"

#include <algorithm>
#include <cstdlib>
#include <tuple>

namespace romap::files {

std::vector<std::pair<size_t, size_t>> AssociateTimestamps(std::span<const int64_t> a, std::span<const int64_t> b,
                                                           int64_t max_dt_ns) {
  std::vector<std::tuple<int64_t, size_t, size_t>> candidates;
  size_t first = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    while (first < b.size() && b[first] < a[i] - max_dt_ns) ++first;
    for (size_t j = first; j < b.size() && b[j] <= a[i] + max_dt_ns; ++j) {
      candidates.emplace_back(std::abs(a[i] - b[j]), i, j);
    }
  }
  std::sort(candidates.begin(), candidates.end());
  std::vector<bool> used_a(a.size()), used_b(b.size());
  std::vector<std::pair<size_t, size_t>> pairs;
  for (const auto& [dt_ns, i, j] : candidates) {
    if (used_a[i] || used_b[j]) continue;
    used_a[i] = used_b[j] = true;
    pairs.emplace_back(i, j);
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

int64_t MedianStep_ns(std::span<const int64_t> times_ns) {
  std::vector<int64_t> steps_ns;
  for (size_t k = 1; k < times_ns.size(); ++k) steps_ns.push_back(times_ns[k] - times_ns[k - 1]);
  if (steps_ns.empty()) return 0;
  const auto middle = steps_ns.begin() + static_cast<std::ptrdiff_t>(steps_ns.size() / 2);
  std::nth_element(steps_ns.begin(), middle, steps_ns.end());
  return *middle;
}

}  // namespace romap::files
