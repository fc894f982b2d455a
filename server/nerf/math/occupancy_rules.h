#pragma once

// Rules that update the occupancy grid from the samples of a training step. Weights and scores belong to cells and are
// in 0..1.

#include <cstdint>

#include "server/nerf/math/target.h"

namespace romap::nerf {

// Score of a cell after a sample of `weight`: that weight or the decayed score, whichever is larger.
ROMAP_HD float ScoreAfterVisit(float score, float weight, float decay) {
  const float decayed = score * decay;
  return weight > decayed ? weight : decayed;
}

// Score of a cell after `visits` samples in any order, where `weight` is their largest weight.
ROMAP_HD float ScoreAfterVisits(float score, float weight, uint32_t visits, float decay) {
  // The negated comparison makes a NaN weight count as no weight.
  for (; visits > 0 && !(weight >= score); --visits) score *= decay;
  return weight > score ? weight : score;
}

// Schedule of the updates of the occupied cells: after every `interval`-th step from step `start` on.
struct OccupancyPlan {
  uint64_t start = 0;
  uint64_t interval = 1;
};

// `steps_done` includes the step that just ended.
ROMAP_HD bool OccupancyUpdateIsDue(const OccupancyPlan& plan, uint64_t steps_done) {
  return steps_done >= plan.start && steps_done % plan.interval == 0;
}

// A live cell keeps itself and its neighbors occupied if they lie in the visual hull.
ROMAP_HD bool IsLive(float score, float threshold) { return score > threshold; }

// A row of cells, one bit each, with the neighbors of every set bit.
ROMAP_HD uint64_t WithNeighborsInRow(uint64_t row) { return row | row << 1 | row >> 1; }

// The weight of a layer of cells fades at every update, because in early steps rays end all over the hull.
template <class T>
ROMAP_HD T FadedLayerWeight(T weight) {
  return weight / 2;
}

}  // namespace romap::nerf
