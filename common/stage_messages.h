#pragma once

// The messages between the stages of a session, in the order of the data path. All are plain values. A cv::Mat in a
// message is never written to after the message was sent, because several messages may share its pixels.

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "common/camera_model.h"
#include "common/client_input.h"
#include "common/cuboid.h"
#include "common/geometry.h"
#include "common/ids.h"
#include "common/map_events.h"
#include "common/pose_uncertainty.h"

namespace romap {

// --------------------------------------------------------------------------------------------------- ingest -> slam

// A mask that shows no object, with what the detector called it. Its pixels have label 0 or kIgnoreLabel.
struct NonObjectMask {
  cv::Rect box_px;
  std::string class_name;
  const char* reason = "";  // why it shows no object, as text for clients
};

// A decoded and validated frame.
struct Frame {
  uint64_t frame_id = 0;
  int64_t timestamp_ns = 0;
  CameraModel camera;  // after undistortion: distortion is all zero and all pixels below follow the pinhole model
  cv::Mat image_bgr;   // CV_8UC3
  // The image before undistortion, for stages that undistort points instead of images. Empty for a pinhole lens: then
  // image_bgr is that image.
  cv::Mat source_gray;        // CV_8UC1
  CameraModel source_camera;  // of source_gray, with its distortion
  bool has_masks = false;     // false: no detector ran on this frame (as opposed to a detector that found nothing)
  cv::Mat labels;             // CV_16UC1, 0 = no instance, kIgnoreLabel = unknown; empty if !has_masks
  std::vector<Instance> instances;
  std::vector<NonObjectMask> non_objects = {};
  cv::Mat depth_mu;  // CV_32FC1, z depth in map units, 0 = unknown; empty if the frame has no depth
  std::optional<SE3<World, Camera>> T_world_camera;
  std::optional<Eigen::Vector3d> gravity_camera;  // unit length
};

// The masks of a frame that was passed on without masks, for detectors that are slower than the camera.
struct FrameMasks {
  uint64_t frame_id = 0;
  cv::Mat labels;  // CV_16UC1, size of the frame, 0 = no instance, kIgnoreLabel = unknown
  std::vector<Instance> instances;
  std::vector<NonObjectMask> non_objects = {};
};

// -------------------------------------------------------------------------------------------------- slam -> objects

// The current state of a sparse map point.
struct MapPoint {
  MapPointId id;
  Eigen::Vector3d position_world;  // map units
  int observations = 0;            // number of keyframes that observe it
  double max_parallax_rad = 0;     // largest angle between two of its observation rays
};

// The observation of a map point in one keyframe.
struct PointObservation {
  MapPointId point;
  Eigen::Vector2f pixel_px;
  uint16_t label = 0;  // of that keyframe's mask at the pixel, 0 = no instance
};

// A frame with its tracking result, in frame order.
struct TrackedFrame {
  std::shared_ptr<const Frame> frame;
  TrackingState state = TrackingState::kTracking;
  SE3<World, Camera> T_world_camera;
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();  // unit length, against gravity
  bool is_keyframe = false;
  // The keyframe that the pose is relative to: T_world_camera = T_world_reference * T_reference_camera at the time of
  // tracking. When the reference is corrected, the frame moves with it. The translation is in the map unit at the time
  // of the reference's creation: multiply it by all later scale corrections of the reference. 0: the pose was given and
  // is never corrected.
  KeyframeId reference = {};
  SE3<Camera, Camera> T_reference_camera = {};
  std::string reason = {};  // human-readable: why the frame is not tracked; empty while tracking
  SparseMapId map = {};     // the map that the pose refers to; 0: none
  // Of T_world_camera at the time of tracking. nullopt: the frame is not tracked, or its pose was given.
  std::optional<PoseUncertainty> uncertainty = {};
  PoseUncertainty reference_uncertainty = {};  // of T_reference_camera, in its unit
  // While the frame is not tracked: its rotation, if the camera rotates in place. In the world of the last map, or in a
  // provisional one before there is a map.
  std::optional<Eigen::Quaterniond> R_world_camera = {};
  // The given poses (then the frame is lost) or the depth images of the frames since this one contradict the images.
  // They were used before that was known: objects that were found by them are wrong. 0: no contradiction.
  uint64_t contradicted_since_frame = 0;
};

// A keyframe with its part of the sparse map. `points` holds the current position of every point in `observations`;
// later keyframes may refine it.
struct KeyframeView {
  KeyframeId id;
  std::shared_ptr<const Frame> frame;
  SE3<World, Camera> T_world_camera;
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();
  std::vector<PointObservation> observations;
  std::vector<MapPoint> points;
  std::vector<MapPointId> removed_points;  // culled since the last keyframe
};

// The motion of one keyframe since it was last published.
struct KeyframeCorrection {
  KeyframeId id;
  SE3<World, Camera> T_world_camera;  // corrected pose
  // Motion of the space around the keyframe: p_new = S_new_old * p_old. Rotation and translation follow from the old
  // and the new pose; the scale is 1 unless the scale of a monocular map changed here.
  Sim3<World, World> S_new_old;
};

// Two maps of a session were found to show a common place: everything in `from` belongs to `into` now, and was moved
// into its world.
struct MapMerge {
  SparseMapId from;
  SparseMapId into;
};

// A change of poses and points that were already published: bundle adjustment, loop closure, gravity, scale, or the
// merge of two maps.
struct MapCorrection {
  std::vector<KeyframeCorrection> keyframes;  // those that moved noticeably, by id
  std::vector<MapPoint> points;               // those that moved, with their new positions
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();
  // The uncertainties of all keyframes that were published; empty unless they changed.
  std::map<KeyframeId, PoseUncertainty> uncertainties = {};
  std::vector<MapMerge> merged_maps =
      {};  // in the order of the merges; the motion of their keyframes is in `keyframes`
};

// -------------------------------------------------------------------------------------------------- objects -> nerf

enum class RayKind : uint8_t { kBackground = 0, kObject = 1, kOccluder = 2 };

// One training view of one object: a crop of a keyframe. Pixels outside the crop are unknown.
struct ObjectView {
  ObjectId object;
  KeyframeId keyframe;
  CameraModel camera;  // of the full image, without distortion
  SE3<World, Camera> T_world_camera;
  cv::Rect roi_px;    // the crop in the full image
  cv::Mat color_bgr;  // CV_8UC3, size of roi_px
  cv::Mat ray_kind;   // CV_8UC1 of RayKind, size of roi_px
  cv::Mat depth_mu;   // CV_32FC1, dense z depth, 0 = unknown, size of roi_px; empty if the frame has no depth
  std::vector<Eigen::Vector3f> sparse_depth;  // (u_px, v_px, z_mu) of the object's map points in full-image pixels
};

// The corrected pose of a view that was sent before.
struct ViewPose {
  KeyframeId keyframe;
  SE3<World, Camera> T_world_camera;
};

// Changes of one object for its training. The correction applies first: cuboid and new views are already in the
// corrected world.
struct ObjectViews {
  ObjectId object;
  std::optional<Sim3<World, World>> S_new_old = {};  // motion of the space around the object; the field moves with it
  std::vector<ViewPose> corrected_views = {};        // in the corrected world
  Cuboid cuboid;  // training box before enlargement; may be larger than the cuboid that clients see
  std::vector<ObjectView> new_views = {};
};

}  // namespace romap
