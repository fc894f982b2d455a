#pragma once

#include <cstddef>
#include <vector>

#include "server/slam/features/feature.h"
#include "server/slam/frame_features.h"
#include "server/slam/geometry/two_view.h"

namespace romap::slam {

// Two features of one point as a match of two views. Its standard deviation is that of the coarser octave;
// `pixel_sigma_px`: of octave 0.
TwoViewMatch MakeTwoViewMatch(const Feature& first, const Feature& second, double pixel_sigma_px);

struct FrameMatching {
  int max_distance_bits = 0;    // see MatchDescriptors
  double max_ratio = 1;         // the same
  size_t max_first = SIZE_MAX;  // about this many features of the first frame are matched, evenly spread
};

// Matches the features of two frames by their descriptors.
std::vector<TwoViewMatch> MatchFrames(const FrameFeatures& first, const FrameFeatures& second,
                                      const FrameMatching& options, double pixel_sigma_px);

}  // namespace romap::slam
