#pragma once

#include <span>
#include <vector>

#include "server/slam/features/feature.h"

namespace romap::slam {

struct DescriptorMatch {
  int first = 0;   // index
  int second = 0;  // index
  int distance = 0;
};

// Brute-force matching: pairs of mutually nearest descriptors that are at most `max_distance` bits apart and whose
// distance is less than `ratio` times the distance to the second nearest in `second`. In order of `first`. Uses the
// popcnt instruction if the CPU has it.
std::vector<DescriptorMatch> MatchDescriptors(std::span<const Descriptor> first, std::span<const Descriptor> second,
                                              int max_distance, double ratio);

}  // namespace romap::slam
