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

// All against all: pairs that are each other's best, at most `max_distance` bits apart, and whose distance is below
// `ratio` times that of the second best of `second`. In order of `first`. Uses the processor's bit count where it has
// one.
std::vector<DescriptorMatch> MatchDescriptors(std::span<const Descriptor> first, std::span<const Descriptor> second,
                                              int max_distance, double ratio);

}  // namespace romap::slam
