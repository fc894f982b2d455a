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

// Matches the features of `first` that have no map point yet with those of `second`. The known poses make the search
// one-dimensional: all rays of one epipolar plane share the angle around the baseline, and a pair of them meets at the
// difference of their angles with the baseline, the parallax. A match is the best of its candidates from both sides and
// clearly better than the second best. In order of `first`.
std::vector<FeatureMatch> MatchAlongEpipolarPlanes(const MapKeyframe& first, const MapKeyframe& second,
                                                   const SlamConfig& config);

}  // namespace romap::slam
