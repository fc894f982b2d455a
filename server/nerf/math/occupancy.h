#pragma once

#include <cstdint>

#include "server/nerf/math/target.h"

namespace romap::nerf {

// Score of an occupancy cell in which `visits` samples fell, the largest weight among them being `weight`: what is
// larger, that or the old score, decayed once a visit. It does not depend on the order of the visits.
ROMAP_HD float CellScore(float score, float weight, uint32_t visits, float decay) {
  // Written so that a weight that is not a number counts as none.
  for (; visits > 0 && !(weight >= score); --visits) score *= decay;
  return weight > score ? weight : score;
}

}  // namespace romap::nerf
