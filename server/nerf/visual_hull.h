#pragma once

#include <cstdint>
#include <vector>

#include "common/stage_messages.h"
#include "server/hull/evidence_grid.h"
#include "server/nerf/input_quality.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/training_box.h"

namespace romap::nerf {

// The cells of the training box that may be occupied according to the views. A view is evidence for background if the
// whole footprint of the cell is background, or if dense depth was measured behind it; it is evidence for the object if
// any pixel of the footprint shows the object.
class VisualHull {
 public:
  explicit VisualHull(const NerfConfig& config);

  // Removes all views; the hull is the whole box. Consistent depth carves too, and background pixels within the
  // uncertain border of the mask are no evidence.
  void Reset(const TrainingBox& box, const InputQuality& quality = {});
  void Add(const ObjectView& view) { Count(view, 1); }
  // `view` must be the same as when it was added.
  void Remove(const ObjectView& view) { Count(view, -1); }
  // 1 = may be occupied, index as in OccupancyBits, kOccupancyResolution^3. All 1 if `carve_hull` is off.
  std::vector<uint8_t> Carve() const;

 private:
  struct Verdict;
  class Footprints;

  static hull::CellEvidence EvidenceOf(const Verdict& verdict, bool in_front_of_depth);
  double CellRadius_mu() const;  // of a footprint
  void Count(const ObjectView& view, int sign);
  void CountBlock(const Footprints& footprints, const Eigen::Vector3i& first, int side, int sign);

  TrainingBox box_;
  bool carve_;
  InputQuality quality_;
  double margin_;
  hull::CarvingRule rule_;
  int views_ = 0;
  hull::EvidenceGrid evidence_;
};

}  // namespace romap::nerf
