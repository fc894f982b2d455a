#pragma once

#include <Eigen/Core>
#include <functional>
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

// Owns the landmarks, their keys, the map points with the landmark each belongs to, and the up direction along which
// cuboids stand.
class LandmarkStore {
 public:
  using Landmarks = std::vector<std::unique_ptr<Landmark>>;

  explicit LandmarkStore(const ObjectsConfig& config) : config_(config) {}

  // In the order of their first observation.
  const Landmarks& landmarks() const { return landmarks_; }
  std::vector<LandmarkKey> Keys() const;
  // nullptr for a key that was removed or kNoLandmark.
  Landmark* Find(LandmarkKey key) const;
  // A new provisional landmark. Keys are never reused.
  Landmark& Create();
  void RemoveIf(const std::function<bool(const Landmark&)>& condition);
  // Removes all landmarks and points.
  void Clear();

  const PointRegistry& points() const { return points_; }
  void UpdatePoints(const KeyframeView& view) { points_.UpdatePositions(view); }
  // Each labeled point observation is a vote for the landmark of its mask.
  void CountPointVotes(const KeyframeView& view, const FrameDetections& frame);

  const Eigen::Vector3d& up_world() const { return up_world_; }
  // Ignored unless finite and of about unit length.
  void SetUp(const Eigen::Vector3d& up_world);

  // Counts which landmarks had a mask in the same frame, and which were covered by the mask of another one.
  // `covered_by`: see Association, for the first landmarks of the store.
  void CountCoVisibility(const FrameDetections& frame, const std::vector<int>& covered_by);

  // Adds evidence, points and, with `adopt_silhouettes`, the shape of `from` to `into`. `from` stays until
  // RemoveMerged(), but every count of other landmarks refers to `into`.
  void Merge(Landmark& from, Landmark& into, bool adopt_silhouettes);
  // Removes `from`. `into` takes its position if that is the earlier one.
  void RemoveMerged(LandmarkKey from, LandmarkKey into);

  void MovePoints(const std::vector<MapPoint>& points) { points_.MovePoints(points); }
  // Moves a landmark with the keyframes that observed it. Returns the motion of its space, nullopt when none of these
  // keyframes was corrected.
  std::optional<Sim3<World, World>> Correct(Landmark& landmark, const KeyframeCorrections& keyframes) const;

 private:
  ObjectsConfig config_;
  Landmarks landmarks_;
  PointRegistry points_;
  Eigen::Vector3d up_world_ = Eigen::Vector3d::UnitZ();
  LandmarkKey last_key_ = 0;
};

}  // namespace romap::objects
