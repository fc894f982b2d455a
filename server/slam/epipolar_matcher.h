#pragma once

#include <vector>

#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"

namespace romap::slam {

struct FeatureMatch {
  int first = 0;   // feature of the first keyframe
  int second = 0;  // feature of the second keyframe
  int distance = 0;
};

// Matches the features of `first` without a map point with those of `second`. The known poses make the search
// one-dimensional: all rays in one epipolar plane have the same azimuth around the baseline, and the parallax of two of
// them is the difference of their angles with the baseline. A match is the best candidate of both features and clearly
// better than the second best. In order of `first`.
std::vector<FeatureMatch> MatchAlongEpipolarPlanes(const MapKeyframe& first, const MapKeyframe& second,
                                                   const SlamConfig& config);

}  // namespace romap::slam
