#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "common/scaled_pose.h"
#include "common/stage_messages.h"
#include "server/slam/frame_features.h"
#include "server/slam/optimize/bundle_adjustment.h"
#include "server/slam/slam_config.h"
#include "server/slam/triangulation.h"

namespace romap::slam {

// Keyframes count as neighbors if they share at least this many points.
inline constexpr int kMinSharedPoints = 15;

// A keyframe of the sparse map.
struct MapKeyframe {
  KeyframeId id;
  std::shared_ptr<const FrameFeatures> frame;
  bool pose_given = false;              // by the client: nothing may move it
  std::optional<PosePrior> prior = {};  // what the client believes of its pose
  size_t scene_features = 0;            // the first ones: those that an ordinary frame has too
  std::vector<MapPointId> points = {};  // one per feature, 0 = none
  KeyframeId parent = {};               // the keyframe it shared most points with when it came; 0 for the first
  std::vector<std::pair<KeyframeId, Sim3<Camera, Camera>>> loops = {};  // S_this_other, found by their looks
  double scale = 1;  // product of all scale corrections of the map around it

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

// A map point with all that is needed to find it again and to place it better.
struct PointTrack {
  MapPoint point;
  std::vector<FeatureRef> observations = {};                   // by keyframe
  Descriptor descriptor{};                                     // the sight's that differs least from all others
  Eigen::Vector3d direction_world = Eigen::Vector3d::UnitZ();  // unit length, mean of the rays that saw it
  double size_mu = 0;          // width of one pixel of the feature's own octave at the point: size that does not change
  uint64_t born_keyframe = 0;  // number of the keyframe that made it
  uint64_t latest_keyframe = 0;  // number of the newest keyframe that saw it
  MaskVotes votes = {};          // of masked frames that are no keyframes
};

// The keyframes and points of one session. For one thread. Ids are never used twice.
//
// Invariant: keyframe k lists point p at feature f if and only if p lists the sight (k, f).
class SlamMap {
 public:
  // Ids go on after those that an earlier map of the session used up.
  explicit SlamMap(const SlamConfig& config, uint64_t keyframes_used = 0, uint64_t points_used = 0)
      : config_(config), keyframe_count_(keyframes_used), point_count_(points_used) {}

  MapKeyframe& AddKeyframe(std::shared_ptr<const FrameFeatures> frame, const SE3<World, Camera>& T_world_camera);
  PointTrack& AddPoint(const Eigen::Vector3d& position_world);
  // Ties a feature to a point. False and nothing changed: the feature has a point or the point is seen there already.
  bool AddObservation(PointTrack& track, MapKeyframe& keyframe, int feature);
  // Unties them. A point that is left with fewer than two sights (one, if depth gave it) goes.
  void RemoveObservation(MapPointId point, KeyframeId keyframe);
  void RemovePoint(MapPointId point);
  // `from` is gone; its sights count for `into` where that is possible.
  void MergePoints(MapPointId from, MapPointId into);
  // Its children are given to its parent; its place relative to that is remembered (see KeyframePose).
  void RemoveKeyframe(KeyframeId keyframe);

  // nullptr: unknown or gone. A merged point answers for those that became it.
  PointTrack* FindPoint(MapPointId point);
  const PointTrack* FindPoint(MapPointId point) const { return const_cast<SlamMap*>(this)->FindPoint(point); }
  MapKeyframe* FindKeyframe(KeyframeId keyframe);
  const MapKeyframe* FindKeyframe(KeyframeId keyframe) const {
    return const_cast<SlamMap*>(this)->FindKeyframe(keyframe);
  }

  // The current pose of a keyframe. One that was removed moves with its parent.
  std::optional<ScaledPose> KeyframePose(KeyframeId keyframe) const;

  // Keyframes that share at least `min_shared` points with this one, most first (then the newest).
  std::vector<std::pair<KeyframeId, int>> Covisible(const MapKeyframe& keyframe, int min_shared) const;

  ObservedRay RayOf(const MapKeyframe& keyframe, int feature) const;
  // A diverse selection of at most `max_rays` sights.
  std::vector<ObservedRay> RaysOf(const PointTrack& track, size_t max_rays = 16) const;
  // Looks, direction, size and parallax anew, after its sights or the map around it changed.
  void Refresh(PointTrack& track) const;

  // What is left of the lens, by which all keyframes are corrected.
  const RadialCorrection& lens() const { return lens_; }
  // The points stay where they are: for an adjustment that found places for them, too.
  void CorrectLens(const RadialCorrection& lens);

  // Applies a similarity to everything.
  void Transform(const Sim3<World, World>& S_new_old);

  std::map<KeyframeId, MapKeyframe>& keyframes() { return keyframes_; }
  const std::map<KeyframeId, MapKeyframe>& keyframes() const { return keyframes_; }
  std::map<MapPointId, PointTrack>& points() { return points_; }
  const std::map<MapPointId, PointTrack>& points() const { return points_; }
  uint64_t keyframe_count() const { return keyframe_count_; }  // ids used so far
  uint64_t point_count() const { return point_count_; }
  // Points that went since the last call.
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
