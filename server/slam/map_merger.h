#pragma once

#include <map>
#include <optional>
#include <vector>

#include "server/slam/common_place.h"
#include "server/slam/map_atlas.h"
#include "server/slam/merge_trial.h"
#include "server/slam/rejected_pairs.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// Merges the current map with a kept map when they are proven to show a common place. A place that looks alike is not
// proof: textures repeat. Two maps are merged only if
// - several consecutive keyframes of the current map find the same similarity to the kept map,
// - neither map has another place that fits as well, and
// - the merged map, adjusted on a copy in the background, explains the observations of both (MergeTrial).
// The map with fewer keyframes moves into the world of the other one; a map with depth images keeps its scale, and
// one in the client's world stays there. Not thread-safe.
class MapMerger {
 public:
  // `run_inline`: the trial is finished when Observe() returns.
  MapMerger(const SlamConfig& config, bool run_inline) : config_(config), trial_(config, run_inline) {}

  // Call for each keyframe of the current map, in order. Starts the trial of a merge when a common place is proven.
  void Observe(const MapKeyframe& keyframe, const MapAtlas& atlas);
  // When a trial is finished, merges the two maps or rejects the merge. `wait`: blocks until it is finished. Returns
  // the merge of the maps in the atlas.
  std::optional<MapMerge> Conclude(bool wait, MapAtlas& atlas);
  // Another map became the current one.
  void Forget();

  int rejected() const { return rejections_; }

 private:
  void Reject(const CommonPlace& place);
  void StartTrial(const MapAtlas& atlas);

  const SlamConfig config_;
  std::vector<CommonPlace> agreeing_;              // of consecutive keyframes, with one kept map
  std::map<SparseMapId, RejectedPairs> rejected_;  // by kept map
  MergeTrial trial_;
  CommonPlace tried_;  // while the trial is pending
  int rejections_ = 0;
};

}  // namespace romap::slam
