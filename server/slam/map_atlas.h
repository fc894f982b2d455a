#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/place_recognizer.h"
#include "server/slam/session_map.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// The maps of a session: the current one, in which the camera is tracked, and those that are kept aside because the
// camera was lost in them. Their worlds are not related to each other until two of them are merged (Elvira et al.,
// "ORBSLAM-Atlas", IROS 2019, section III). Kept maps have points. Ids of keyframes and points are unique over all
// maps. Not thread-safe.
class MapAtlas {
 public:
  // The current map is empty and has id 1.
  explicit MapAtlas(const SlamConfig& config);

  SessionMap& current() { return *current_; }
  const SessionMap& current() const { return *current_; }
  const std::vector<std::unique_ptr<SessionMap>>& kept() const { return kept_; }
  // nullptr: unknown, or merged into another one.
  SessionMap* Find(SparseMapId id) const;
  size_t maps() const { return kept_.size() + (current_->IsEmpty() ? 0 : 1); }
  size_t points() const;  // of all maps
  std::vector<Diagnostic> Diagnostics() const;

  // An empty map outside of the atlas. Call Begin() or Discard() with it before the other maps change.
  std::unique_ptr<SessionMap> MakeMap() const;
  // The map becomes the current one. The one before is kept aside unless it is empty.
  void Begin(std::unique_ptr<SessionMap> map);
  // Destroys the map. Its ids of keyframes and points stay used.
  void Discard(std::unique_ptr<SessionMap> map);
  // A kept map becomes the current one, and the one before is kept aside.
  void SwitchTo(SparseMapId kept);
  // Adds `from` to `into`, which is in the same world already. If one of them is current, the result is.
  void Merge(const MapMerge& merge);

  struct Place {
    SparseMapId map;
    LocatedFrame located;
  };
  // Finds the pose of a frame without a prior: in the current map, or else in the kept map with the most matching
  // points. nullopt: no place fits, or several of one map do.
  std::optional<Place> Relocalize(const FrameFeatures& frame) const;

 private:
  // Numbers of keyframes and points that were made in the session.
  std::pair<uint64_t, uint64_t> UsedIds() const;

  const SlamConfig config_;
  std::unique_ptr<SessionMap> current_;
  std::vector<std::unique_ptr<SessionMap>> kept_;  // in the order in which they were set aside
  SparseMapId last_begun_;
};

}  // namespace romap::slam
