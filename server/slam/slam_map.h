#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/pose_uncertainty.h"
#include "common/scaled_pose.h"
#include "common/stage_messages.h"
#include "server/slam/frame_features.h"
#include "server/slam/optimize/bundle_adjustment.h"
#include "server/slam/patch_search.h"
#include "server/slam/slam_config.h"
#include "server/slam/triangulation.h"

namespace romap::slam {

// Keyframes count as neighbors if they share at least this many points.
inline constexpr int kMinSharedPoints = 15;

// A keyframe of the sparse map.
struct MapKeyframe {
  KeyframeId id;
  std::shared_ptr<const FrameFeatures> frame;
  bool pose_given = false;              // by the client; never moved
  std::optional<PosePrior> prior = {};  // the client's estimate of its pose
  size_t scene_features = 0;            // number of scene features, which come before additional object features
  std::vector<MapPointId> points = {};  // one per feature, 0 = none
  KeyframeId parent = {};               // the keyframe it shared most points with when it was added; 0 for the first
  std::vector<std::pair<KeyframeId, Sim3<Camera, Camera>>> loops = {};  // S_this_other, by place recognition
  double scale = 1;                  // product of all scale corrections of the map around it
  PoseUncertainty uncertainty = {};  // see UncertaintyEstimator; 0 for a given pose

  const std::vector<Feature>& features() const { return frame->features; }
  const CameraModel& camera() const { return frame->camera; }
  const SE3<World, Camera>& T_world_camera() const { return T_world_camera_; }
  const SE3<Camera, World>& T_camera_world() const { return T_camera_world_; }
  ScaledPose scaled_pose() const { return {T_world_camera_, scale}; }
  const Eigen::Vector3d& center_world() const { return T_world_camera_.translation(); }
  Eigen::Vector3d BearingWorld(size_t feature) const {
    return T_world_camera_.rotation() * frame->bearings_camera[feature];
  }
  void SetPose(const SE3<World, Camera>& T_world_camera) {
    T_world_camera_ = T_world_camera;
    T_camera_world_ = T_world_camera.Inverse();
  }

 private:
  SE3<World, Camera> T_world_camera_;
  SE3<Camera, World> T_camera_world_;
};

struct FeatureRef {
  KeyframeId keyframe;
  int feature = 0;
};

// A map point with the data for matching it and for refining its position.
struct PointTrack {
  MapPoint point;
  std::vector<FeatureRef> observations = {};                   // by keyframe
  Descriptor descriptor{};                                     // of the observation that differs least from all others
  Eigen::Vector3d direction_world = Eigen::Vector3d::UnitZ();  // unit length, mean of its rays
  double size_mu = 0;             // width of one pixel of the feature's octave at the point; similar in all keyframes
  uint64_t created_keyframe = 0;  // number of the keyframe that created it
  uint64_t latest_keyframe = 0;   // number of the newest keyframe that observes it
  std::shared_ptr<const ReferencePatch> patch = {};  // null until ObservationRefiner sets it
  MaskVotes votes = {};                              // from frames with masks that are not keyframes

  bool IsObservedBy(KeyframeId keyframe) const;
};

// The keyframes and points of one map. Not thread-safe. Ids are never reused within a session.
//
// Invariant: keyframe k lists point p at feature f if and only if p lists the observation (k, f).
class SlamMap {
 public:
  // `keyframes_used`, `points_used`: ids used by earlier maps of the session.
  explicit SlamMap(const SlamConfig& config, uint64_t keyframes_used = 0, uint64_t points_used = 0)
      : config_(config), keyframe_count_(keyframes_used), point_count_(points_used) {}

  MapKeyframe& AddKeyframe(std::shared_ptr<const FrameFeatures> frame, const SE3<World, Camera>& T_world_camera);
  PointTrack& AddPoint(const Eigen::Vector3d& position_world);
  // Records that the feature observes the point. Returns false and changes nothing if the feature already observes a
  // point or the keyframe already observes this one.
  bool AddObservation(PointTrack& track, MapKeyframe& keyframe, int feature);
  // Also removes the point unless at least two observations, or one with depth, are left.
  void RemoveObservation(MapPointId point, KeyframeId keyframe);
  void RemovePoint(MapPointId point);
  // Removes `from` and moves its observations to `into` where possible.
  void MergePoints(MapPointId from, MapPointId into);
  // Its children become children of its parent. Its pose relative to the parent is kept (see KeyframePose).
  void RemoveKeyframe(KeyframeId keyframe);

  // nullptr: unknown or removed. For the id of a merged point, returns the point it was merged into.
  PointTrack* FindPoint(MapPointId point);
  const PointTrack* FindPoint(MapPointId point) const { return const_cast<SlamMap*>(this)->FindPoint(point); }
  MapKeyframe* FindKeyframe(KeyframeId keyframe);
  const MapKeyframe* FindKeyframe(KeyframeId keyframe) const {
    return const_cast<SlamMap*>(this)->FindKeyframe(keyframe);
  }

  // The current pose of a keyframe. A removed keyframe moves with its parent. nullopt if unknown.
  std::optional<ScaledPose> KeyframePose(KeyframeId keyframe) const;

  // The uncertainty of its current pose. nullopt if unknown.
  std::optional<PoseUncertainty> KeyframeUncertainty(KeyframeId keyframe) const;

  // Keyframes that share at least `min_shared` points with this one, sorted by the number of shared points, then by
  // age, the newest first.
  std::vector<std::pair<KeyframeId, int>> Covisible(const MapKeyframe& keyframe, int min_shared) const;

  // Median depth of the points that the keyframe observes; nullopt if it observes none.
  std::optional<double> MedianDepth_mu(const MapKeyframe& keyframe) const;

  ObservedRay RayOf(const MapKeyframe& keyframe, int feature) const;
  // At most `max_rays` of the rays to the point, evenly spread over its observations.
  std::vector<ObservedRay> RaysOf(const PointTrack& track, size_t max_rays = 16) const;
  // Moves the features of a keyframe that has a rolling shutter to where a global shutter would show their points.
  void ConvertByDepth(MapKeyframe& keyframe) const;
  // Recomputes descriptor, direction, size and parallax, after observations or poses changed.
  void Refresh(PointTrack& track) const;

  // The lens correction of all keyframes.
  const RadialCorrection& lens() const { return lens_; }
  // Does not move points, because the adjustment that estimates the lens moves them.
  void CorrectLens(const RadialCorrection& lens);

  // Adds the keyframes and points of another map of the session, which is in the same world. They get the lens
  // correction of this map.
  void Append(SlamMap other);
  // Ids up to these are used by other maps of the session.
  void SkipIds(uint64_t keyframes_used, uint64_t points_used);

  // Applies a similarity to all keyframes and points.
  void Transform(const Sim3<World, World>& S_new_old);

  std::map<KeyframeId, MapKeyframe>& keyframes() { return keyframes_; }
  const std::map<KeyframeId, MapKeyframe>& keyframes() const { return keyframes_; }
  std::map<MapPointId, PointTrack>& points() { return points_; }
  const std::map<MapPointId, PointTrack>& points() const { return points_; }
  uint64_t keyframe_count() const { return keyframe_count_; }  // ids used so far
  uint64_t point_count() const { return point_count_; }
  // Points removed since the last call.
  std::vector<MapPointId> TakeRemovedPoints() { return std::exchange(removed_points_, {}); }

 private:
  struct RemovedKeyframe {
    KeyframeId parent;
    SE3<Camera, Camera> T_parent_this;  // in units of the parent's scale 1
    double relative_scale = 1;          // its scale over the parent's
  };

  const SlamConfig config_;
  RadialCorrection lens_;
  std::map<KeyframeId, MapKeyframe> keyframes_;
  std::map<MapPointId, PointTrack> points_;
  std::unordered_map<MapPointId, MapPointId> merged_into_;
  std::map<KeyframeId, RemovedKeyframe> removed_keyframes_;
  std::vector<MapPointId> removed_points_;
  uint64_t keyframe_count_;
  uint64_t point_count_;
};

}  // namespace romap::slam
