#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "common/stage_messages.h"
#include "server/objects/correction.h"
#include "server/objects/frame_detections.h"
#include "server/objects/landmark.h"
#include "server/objects/objects_config.h"
#include "server/objects/point_registry.h"

namespace romap::objects {

// Owns the landmarks, their keys, the assignment of map points to landmarks, and the up direction of the cuboids.
//
// A session may have several maps whose relation is unknown. The landmarks of all maps but the current one are dormant:
// nothing is observed of them, and all functions concern the others unless their comment says otherwise.
class LandmarkStore {
 public:
  using Landmarks = std::vector<std::unique_ptr<Landmark>>;

  explicit LandmarkStore(const ObjectsConfig& config) : config_(config) {}

  // All landmarks that are not dormant, in the order of their first observation.
  const Landmarks& landmarks() const { return landmarks_; }
  std::vector<LandmarkKey> Keys() const;
  // Returns nullptr for a key that was removed and for kNoLandmark.
  Landmark* Find(LandmarkKey key) const;
  // Creates a provisional landmark. Keys are never reused.
  Landmark& Create();
  void RemoveIf(const std::function<bool(const Landmark&)>& condition);

  // The current map; 0 before SetMap().
  SparseMapId map() const { return map_; }
  // All maps that have landmarks or points, the current one last.
  std::vector<SparseMapId> Maps() const;
  // Makes a map the current one: its landmarks wake up, those of the map before become dormant.
  void SetMap(SparseMapId map, uint64_t frame_index);
  // The landmarks and points of one map belong to another one now. If one of the two is current, the other wakes up.
  void MergeMaps(const MapMerge& merge, uint64_t frame_index);
  std::vector<Landmark*> DormantLandmarks() const;

  const PointRegistry& points() const { return points_; }
  void UpdatePoints(const KeyframeView& view) { points_.UpdatePositions(view); }
  // Counts each labeled point observation as a vote for the landmark of its mask.
  void CountPointVotes(const KeyframeView& view, const FrameDetections& frame);

  const Eigen::Vector3d& up_world() const { return up_world_; }
  // Sets the up direction. Ignored unless `up_world` is finite and has about unit length.
  void SetUp(const Eigen::Vector3d& up_world);

  // Counts the landmarks that had a mask in the same frame, and those covered by the mask of another landmark.
  // `covered_by`: see Association; may be shorter than the list of landmarks, because new ones are appended.
  void CountCoVisibility(const FrameDetections& frame, const std::vector<int>& covered_by);

  // Adds evidence, points and, with `adopt_silhouettes`, the shape of `from` to `into`. `from` stays until
  // RemoveMerged(), but every count of other landmarks refers to `into`.
  void Merge(Landmark& from, Landmark& into, bool adopt_silhouettes);
  // Removes `from`. If `from` precedes `into` in the list, `into` moves to the position of `from`.
  void RemoveMerged(LandmarkKey from, LandmarkKey into);

  // Moves points of all maps.
  void MovePoints(const std::vector<MapPoint>& points);
  // Moves a landmark, dormant or not, with the keyframes that observed it. Returns the motion of its space, or nullopt
  // when none of these keyframes was corrected.
  std::optional<Sim3<World, World>> Correct(Landmark& landmark, const KeyframeCorrections& keyframes) const;

 private:
  // What belongs to a map that is not the current one.
  struct DormantMap {
    Landmarks landmarks;
    PointRegistry points;
    uint64_t since_frame = 0;
  };

  void WakeUp(SparseMapId map, uint64_t frame_index);

  ObjectsConfig config_;
  SparseMapId map_;
  Landmarks landmarks_;
  PointRegistry points_;
  std::map<SparseMapId, DormantMap> dormant_;
  Eigen::Vector3d up_world_ = Eigen::Vector3d::UnitZ();
  LandmarkKey last_key_ = 0;
};

}  // namespace romap::objects
