#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace romap::files {

// Pairs (i, j) of the timestamps a[i] and b[j] that lie at most max_dt_ns apart, one to one, closest pairs first;
// returned by rising i. `a` and `b` must be sorted. With both at about the same rate this is O((n + m) log(n + m)).
std::vector<std::pair<size_t, size_t>> AssociateTimestamps(std::span<const int64_t> a, std::span<const int64_t> b,
                                                           int64_t max_dt_ns);

}  // namespace romap::files
