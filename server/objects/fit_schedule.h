#pragma once

#include <cstdint>
#include <vector>

#include "server/objects/point_registry.h"

namespace romap::objects {

// A landmark whose box is out of date.
struct FitRequest {
  LandmarkKey key = 0;
  bool confirmed = false;
  int silhouettes = 0;          // that it has
  int news = 0;                 // of these, such as came or were corrected since its last fit
  uint64_t waiting_frames = 0;  // since its last fit
};

// Whether there is enough news for a fit: the better an object is known, the less one more silhouette changes.
bool IsWorthAFit(const FitRequest& request);

// Keys by need, the neediest first: by the share of silhouettes that is news, what is not confirmed before what is, and
// the more the longer it waits, so that everyone's turn comes. Ties go to the older landmark.
std::vector<LandmarkKey> OrderByNeed(const std::vector<FitRequest>& requests);

}  // namespace romap::objects
