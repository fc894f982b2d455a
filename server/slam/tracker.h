#pragma once

#include <absl/status/statusor.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/client_input.h"
#include "common/map_events.h"
#include "common/stage_messages.h"
#include "server/slam/features/feature_extractor.h"
#include "server/slam/frame_features.h"
#include "server/slam/geometry/pose_refiner.h"
#include "server/slam/given_pose_tracker.h"
#include "server/slam/keyframe_selector.h"
#include "server/slam/local_map.h"
#include "server/slam/monocular_initializer.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// What tracking says of one frame, for the mapping thread.
struct TrackedImage {
  TrackedFrame tracked;
  std::shared_ptr<const FrameFeatures> features = {};  // none: the pose was given and the frame is no keyframe
  std::vector<MapPointId> points = {};                 // keyframes: per feature of `features`, 0 = none
  std::optional<InitialViews> initial_views = {};      // a map can be initialized with this frame
  bool pose_given = false;                             // by the client: nothing may correct it
  int generation = 0;                                  // of the local map it was tracked against
};

// Turns frames into frames with camera poses: takes the poses that come with them, or tracks the camera from the images
// against the local map. Frames come in order of time, from one thread, which never waits for mapping: it reads the
// newest local map there is.
//
// Tracking from images: the motion of the last frames predicts the pose; the points of the last frame are looked for
// around their projections; if that fails, in a wider area and then by looks alone (P3P); then all points of the local
// map are looked for around the refined pose, and the pose is refined on all of them (Mur-Artal et al. 2015, section
// V).
class Tracker {
 public:
  // `local_map` outlives the tracker.
  Tracker(const SlamConfig& config, PoseUse pose_use, const LocalMapSlot* local_map);

  // Never refuses a decoded frame: one without a pose says why in `tracked.reason`.
  TrackedImage Track(std::shared_ptr<const Frame> frame);

 private:
  // Points of the local map found in a frame.
  struct Attempt {
    SE3<World, Camera> T_world_camera;
    std::vector<int> point_of_feature;  // index into the local map, -1 = none
    int inliers = 0;
    int matches = 0;
  };

  TrackedImage TakeGivenPose(std::shared_ptr<const Frame> frame);
  TrackedImage Initialize(std::shared_ptr<const Frame> frame, std::shared_ptr<const FrameFeatures> features);
  TrackedImage TrackByImage(std::shared_ptr<const Frame> frame, std::shared_ptr<const FrameFeatures> features);

  void TakeNewestMap();
  SE3<World, Camera> Predict(const Frame& frame) const;
  std::optional<Attempt> FindCamera(const Frame& frame, const FrameFeatures& features);
  std::optional<Attempt> FollowLastPoints(const FrameFeatures& features, const SE3<World, Camera>& start,
                                          double radius_px) const;
  std::optional<Attempt> FindByLooks(const FrameFeatures& features) const;
  std::optional<Attempt> TrackNearRelocalization(const FrameFeatures& features) const;
  std::optional<Attempt> UseWholeLocalMap(const FrameFeatures& features, const Attempt& first) const;
  std::optional<Attempt> Refine(const FrameFeatures& features, const SE3<World, Camera>& start,
                                std::vector<int> point_of_feature, int min_inliers) const;
  void Accept(const Frame& frame, const FrameFeatures& features, const Attempt& attempt, TrackedImage& image);
  void Lose(const std::string& why, TrackedImage& image);
  bool DecideKeyframe(const Frame& frame, const FrameFeatures& features, const Attempt& attempt);
  void AnchorToReference(TrackedFrame& tracked) const;

  const SlamConfig config_;
  const PoseUse pose_use_;
  const LocalMapSlot* const slot_;

  FeatureExtractor extractor_;
  GivenPoseTracker given_;
  MonocularInitializer monocular_initializer_;
  KeyframeSelector selector_;
  std::shared_ptr<const LocalMap> map_;

  TrackingState state_ = TrackingState::kInitializing;
  bool world_is_given_ = false;   // the map's world is that of the client's poses
  bool waiting_for_map_ = false;  // a start was handed on
  int waiting_generation_ = 0;    // of the map when it was
  uint64_t keyframes_sent_ = 0;
  int frames_since_found_ = 0;  // since the camera was found again
  uint64_t lost_since_frame_ = 0;
  std::vector<MapPointId> last_points_;  // seen in the last tracked frame
  std::optional<SE3<World, Camera>> last_pose_;
  std::optional<SE3<World, Camera>> last_prior_;  // what the client said of the last tracked frame
  int64_t last_timestamp_ns_ = 0;
  std::optional<SE3<Camera, Camera>> motion_;  // T_previous_last
  double motion_s_ = 0;                        // the time it took
};

}  // namespace romap::slam
