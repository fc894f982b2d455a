#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/features/feature_extractor.h"
#include "server/slam/fixed_features.h"
#include "server/slam/frame_converter.h"
#include "server/slam/frame_features.h"
#include "server/slam/given_pose_checks.h"
#include "server/slam/given_pose_tracker.h"
#include "server/slam/keyframe_selector.h"
#include "server/slam/local_map.h"
#include "server/slam/local_map_tracking.h"
#include "server/slam/monocular_initializer.h"
#include "server/slam/motion_model.h"
#include "server/slam/readout_check.h"
#include "server/slam/rolling_shutter.h"
#include "server/slam/rotation_tracker.h"
#include "server/slam/slam_config.h"
#include "server/slam/tentative_points.h"
#include "server/slam/tracking_status.h"

namespace romap::slam {

// The result of tracking one frame, for the mapping thread.
struct TrackedImage {
  TrackedFrame tracked;  // its frame is as if a global shutter had taken it, if its motion is known
  std::shared_ptr<const FrameFeatures> features = {};  // null: the pose was given and the frame is not a keyframe
  std::vector<Eigen::Vector2f> fixed_px = {};          // features that are fixed to the camera, not in `features`
  std::vector<MapPointId> points = {};                 // tracked: per feature of `features`, 0 = none
  std::optional<InitialViews> initial_views = {};      // a new map can be initialized with this frame
  bool pose_given = false;                             // by the client; must not be corrected
  bool discard_points = false;                         // those of the map: their depth images contradict the poses
  bool pose_ignored = false;                           // the client gave one, but the world was started from images
  int generation = 0;                                  // of the local map it was tracked against
  std::vector<Diagnostic> diagnostics = {};            // about the camera, its poses and depth images, while they last
};

// Finds the camera pose of each frame: uses the given pose, or tracks the camera from the image against the local map.
// Call Track() from one thread in the order of time stamps. It never waits for mapping, but uses the newest local map
// available.
//
// Tracking from images: the motion of the last frames predicts the pose; the points of the last frame are searched
// around their projections; if that fails, in a wider area and then by descriptors alone (P3P). Then all points of the
// local map are searched around the refined pose, and the pose is refined by all of them (Mur-Artal et al. 2015,
// section V). While the camera is lost for longer, it is still searched in the known maps, and at the same time its
// frames are used to find initial views for a new map.
//
// A frame of a rolling shutter is converted by the motion of the camera during its readout: its features before they
// are matched, again when its pose is known, and then the frame itself, for all later stages.
class Tracker {
 public:
  // `local_map` outlives the tracker.
  Tracker(const SlamConfig& config, PoseUse pose_use, const LocalMapSlot* local_map);

  // If no pose is found, `tracked.reason` is a text for users that explains why.
  TrackedImage Track(std::shared_ptr<const Frame> frame);
  // The masks of a frame that was tracked without masks, as they belong to the frame in its TrackedImage.
  FrameMasks ConvertMasks(const FrameMasks& masks) const { return converter_.ConvertMasks(masks); }

 private:
  // Initial views that were sent to mapping, while the initialized map is pending.
  struct PendingMap {
    int generation = 0;  // of the local map when they were sent
    int64_t first_timestamp_ns = 0;
    int64_t newest_timestamp_ns = 0;  // equal if there is only one view
  };

  void TakeNewestMap();
  void AdoptNewMap(const LocalMap& newest);
  void AdoptKnownMap(const LocalMap& newest);
  void StartMotion(const LocalMap& initial, const PendingMap& pending);
  bool HasMap() const { return map_ && !map_->points.empty(); }
  bool ShouldUseGivenPose(const Frame& frame) const;

  std::vector<Feature> RemoveFixed(const Frame& frame, std::vector<Feature> features);
  TrackedImage UseGivenPose(std::shared_ptr<const Frame> frame, const cv::Mat& depth_mu);
  void RefuseGivenPose(TrackedImage& image, const char* reason, uint64_t since_frame);
  void RefuseDepth(TrackedImage& image);
  TrackedImage Initialize(std::shared_ptr<const Frame> frame, std::shared_ptr<const FrameFeatures> features);
  void FindInitialViews(TrackedImage& image, std::string* reason);
  TrackedImage TrackByImage(std::shared_ptr<const Frame> frame, std::shared_ptr<const FrameFeatures> features);

  std::shared_ptr<const LocalMap> MapForNextFrame();
  std::optional<PoseFromPoints> FindPose(const Frame& frame, const LocalMapTracking& tracking) const;
  std::optional<PoseFromPoints> FindFirstPose(const Frame& frame, const LocalMapTracking& tracking) const;
  std::optional<PoseFromPoints> ConfirmByAllPoints(const Frame& frame, const PoseFromPoints& first,
                                                   const LocalMapTracking& tracking) const;
  // `local_map`: that `pose` refers to.
  void Accept(const PoseFromPoints& pose, const LocalMap& local_map, const LocalMapTracking& tracking,
              TrackedImage& image);
  // `rolling`: the features at their pixels in the image.
  void AcceptConverted(const std::shared_ptr<const RollingShutter>& shutter, const FrameFeatures& rolling,
                       const PoseFromPoints& pose, const LocalMap& local_map, const LocalMapTracking& tracking,
                       TrackedImage& image);
  void CheckReadout(const FrameFeatures& rolling, const PoseFromPoints& pose, const LocalMapTracking& tracking,
                    const TrackedImage& image);
  void TrackRotation(TrackedImage& image);
  std::vector<Diagnostic> Diagnostics(const Frame& frame) const;
  void MarkLost(const std::string& why, TrackedImage& image);
  bool DecideKeyframe(const TrackedImage& image, double depth_mu, int points_by_feature);
  void AnchorToReference(TrackedFrame& tracked) const;
  void StateUncertainty(const PoseFromPoints& pose, double depth_mu, TrackedFrame& tracked) const;

  const SlamConfig config_;
  const PoseUse pose_use_;
  const LocalMapSlot* const slot_;

  FeatureExtractor extractor_;
  FixedFeatures fixed_features_;
  std::vector<Eigen::Vector2f> fixed_px_;  // in the newest frame
  GivenPoseTracker given_;
  MonocularInitializer monocular_initializer_;
  KeyframeSelector selector_;
  std::shared_ptr<const LocalMap> map_;

  TrackingStatus status_;
  MotionModel motion_;
  std::vector<MapPointId> last_points_;  // matched in the last tracked frame
  TentativePoints tentative_points_;
  RotationTracker rotation_;  // while there is no pose
  bool needs_tentative_points_ = false;
  bool world_is_given_ = false;  // the client's poses define the world
  uint64_t keyframes_sent_ = 0;
  SparseMapId newest_map_;  // of those that the camera was in
  std::optional<PendingMap> pending_map_;
  ReadoutCheck readout_check_;
  GivenPoseChecks given_checks_;
  FrameConverter converter_;
  double scene_depth_mu_ = 0;  // in the last frame; 0: unknown
};

}  // namespace romap::slam
