#pragma once

#include <cstdint>
#include <vector>

#include "common/stage_messages.h"
#include "server/nerf/nerf_config.h"
#include "server/nerf/training_box.h"

namespace romap::nerf {

// The cells of the training box that the masks leave possible (Laurentini, 1994). A view votes against a cell when the
// cell's whole footprint is background in it. A cell outside the crop, or before which an occluder stands, is unknown
// to the view. Votes instead of a plain intersection, because one bad mask would cut the object for good. Dense depth
// votes too, whatever a pixel shows: before what was measured there is nothing.
//
// Nor is possible what only hides behind other things or beyond the crops: some of the views that could show the object
// in a cell must do so.
class VisualHull {
 public:
  explicit VisualHull(const NerfConfig& config);

  // Forgets all votes; the hull is the whole box. `use_depth`: dense depth may vote, if it can be believed.
  void Reset(const TrainingBox& box, bool use_depth = true);
  // A view must be removed with the values with which it was added.
  void Add(const ObjectView& view) { Vote(view, 1); }
  void Remove(const ObjectView& view) { Vote(view, -1); }
  // 1 = may hold matter, index as in OccupancyBits, kOccupancyResolution^3. All of it where `carve_hull` is off.
  std::vector<uint8_t> Carve() const;

 private:
  struct Look;
  struct Footprints;
  double CellRadius_mu() const;  // of a footprint
  void Vote(const ObjectView& view, int sign);
  void VoteBlock(const Footprints& footprints, const Eigen::Vector3i& first, int side, int sign);

  TrainingBox box_;
  bool carve_;
  bool use_depth_ = true;
  double margin_;
  int min_votes_;
  double vote_share_;
  double show_share_;
  int views_ = 0;
  std::vector<uint8_t> seen_;     // views whose crop holds the cell's footprint
  std::vector<uint8_t> against_;  // views that call it empty
  std::vector<uint8_t> shown_;    // views that show the object under it
};

}  // namespace romap::nerf
