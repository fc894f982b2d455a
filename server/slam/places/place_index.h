#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/ids.h"
#include "server/slam/features/feature.h"

namespace romap {

// A keyframe that looks like what was asked for.
struct PlaceMatch {
  KeyframeId keyframe;
  double score = 0;  // 0..1, comparable between queries
};

// Finds keyframes that show the same place, by their binary descriptors alone and without a vocabulary file. For one
// thread at a time.
class PlaceIndex {
 public:
  explicit PlaceIndex(uint64_t seed = 1);

  void Add(KeyframeId keyframe, std::span<const Feature> features);
  void Remove(KeyframeId keyframe);  // unknown: nothing happens
  // The `max_results` best, best first. Scores fall for words that are everywhere.
  std::vector<PlaceMatch> Query(std::span<const Feature> features, int max_results) const;
  size_t size() const;
  size_t bytes() const;  // about, for statistics
};

}  // namespace romap
