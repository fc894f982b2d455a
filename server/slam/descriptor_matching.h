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

// The feature with the most similar descriptor, and the distance to the second most similar one.
struct NearestFeature {
  int index = -1;  // -1: no candidate
  int distance = 256;
  int second_distance = 256;

  bool IsDistinct(int max_distance, double ratio) const {
    return index >= 0 && distance <= max_distance && distance <= ratio * second_distance;
  }
};

// Searches `others` at the indices `candidates`, up to `max_octave_difference` octaves above or below the feature's.
NearestFeature FindNearest(const Feature& feature, std::span<const Feature> others, std::span<const int> candidates,
                           int max_octave_difference);

}  // namespace romap::slam
