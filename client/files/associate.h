#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace romap::files {

// Greedy one-to-one association of two sorted lists of timestamps [ns]: takes the closest pairs first, up to a distance
// of max_dt_ns. Returns pairs (i, j) of indices into `a` and `b` in ascending order of i. O((n + m) log(n + m)) for
// lists of similar rate.
std::vector<std::pair<size_t, size_t>> AssociateTimestamps(std::span<const int64_t> a, std::span<const int64_t> b,
                                                           int64_t max_dt_ns);

// The median step of a sorted list of timestamps; 0 if it has less than two.
int64_t MedianStep_ns(std::span<const int64_t> times_ns);

}  // namespace romap::files
