#pragma once

#include <cstdint>
#include <vector>

#include "server/objects/point_registry.h"

namespace romap::objects {

// A landmark whose cuboid is out of date.
struct FitRequest {
  LandmarkKey key = 0;
  bool confirmed = false;
  int silhouettes = 0;          // number of its silhouettes
  int changed = 0;              // of these, added or corrected since its last fit
  uint64_t waiting_frames = 0;  // since its last fit
};

// Whether enough silhouettes changed: the more silhouettes an object has, the less each silhouette changes its cuboid.
bool IsDueForFit(const FitRequest& request);

// Keys in order of urgency, the most urgent first. Urgency is the share of changed silhouettes times the waiting time,
// and higher for unconfirmed landmarks. The waiting time ensures that every landmark is fitted eventually. Of equally
// urgent landmarks the older one comes first.
std::vector<LandmarkKey> OrderByUrgency(const std::vector<FitRequest>& requests);

}  // namespace romap::objects
