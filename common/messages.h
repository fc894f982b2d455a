#pragma once

// Every arrow of the data path is a type in this file. All are plain values; a cv::Mat in a message is never written to
// after the message was sent (its pixels may be shared by several messages).

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "common/camera_model.h"
#include "common/geometry.h"
#include "common/ids.h"
#include "common/mesh.h"

namespace romap {

// ---------------------------------------------------------------------------------------------- client -> session

enum class ImageEncoding { kJpeg, kPng, kRawRgb8, kRawBgr8, kRawGray8 };
enum class MaskEncoding { kNone, kLabelPng, kRunLength };
enum class DepthEncoding { kNone, kPng16, kRawUint16 };

// What becomes of the camera poses that frames bring.
enum class PoseUse {
  kGiven,   // they are the truth; frames without one are tracked from the image
  kPrior,   // they help tracking from the image and may be corrected
  kIgnore,  // the camera is tracked from the images alone
};

// What one label of a mask image means in this frame only. Labels need not be stable from frame to frame.
struct Instance {
  uint32_t label = 0;  // value in the mask image, 1..65535
  std::string class_name;
  double score = 1.0;                // detector's confidence, 0..1
  std::optional<uint64_t> track_id;  // the detector's own tracker, if it has one; a hint, not a verdict
};

// Which pixel of a frame belongs to which instance, still encoded.
struct EncodedMasks {
  MaskEncoding mask_encoding = MaskEncoding::kNone;
  std::string label_png;  // kLabelPng: 8 or 16 bit single channel, 0 = nothing, size of the image
  std::vector<uint32_t>
      label_runs;                   // kRunLength: (label, length) pairs in row-major order, lengths sum to width*height
  std::vector<Instance> instances;  // labels of the mask that are not listed get class "object", score 1
};

// One frame as a client sends it, still encoded. kNone: no masks, or they follow in a MasksInput.
struct FrameInput : EncodedMasks {
  uint64_t frame_id = 0;     // chosen by the client, strictly increasing within a session
  int64_t timestamp_ns = 0;  // capture time, strictly increasing within a session
  ImageEncoding image_encoding = ImageEncoding::kJpeg;
  std::string image;     // JPEG, PNG or rows of raw pixels without padding
  int raw_width_px = 0;  // raw encodings only
  int raw_height_px = 0;
  std::optional<SE3<World, Camera>> T_world_camera;
  DepthEncoding depth_encoding = DepthEncoding::kNone;
  std::string depth;                              // z depth (not ray length) registered to the image, size of the image
  double depth_scale_mu = 0;                      // map units per depth unit
  std::optional<Eigen::Vector3d> gravity_camera;  // direction of gravity (down) in the camera frame, any length > 0
};

// The masks of a frame that was sent without any: what a detector finds that is slower than the camera.
struct MasksInput : EncodedMasks {
  uint64_t frame_id = 0;  // of a frame that was accepted
};

// All that a client feeds a session with. The order counts: masks come after their frame.
using SessionInput = std::variant<FrameInput, MasksInput>;

// ---------------------------------------------------------------------------------------------- session -> slam

// A decoded and validated frame.
struct Frame {
  uint64_t frame_id = 0;
  int64_t timestamp_ns = 0;
  CameraModel camera;  // after undistortion: distortion is all zero and all pixels below obey the pinhole model
  cv::Mat image_bgr;   // CV_8UC3
  // The picture as the lens gave it, for those who undistort points and not pictures. Empty when the lens is a pinhole:
  // then image_bgr is it.
  cv::Mat source_grey;        // CV_8UC1
  CameraModel source_camera;  // of source_grey, with its distortion
  bool has_masks = false;     // false: no detector ran on this frame (differs from "ran and found nothing")
  cv::Mat labels;             // CV_16UC1, 0 = nothing; empty when !has_masks
  std::vector<Instance> instances;
  cv::Mat depth_mu;  // CV_32FC1 z depth in map units, 0 = unknown; empty when there is none
  std::optional<SE3<World, Camera>> T_world_camera;
  std::optional<Eigen::Vector3d> gravity_camera;  // unit length
};

// The masks of a frame that was handed on without any: detectors are slower than cameras.
struct FrameMasks {
  uint64_t frame_id = 0;
  cv::Mat labels;  // CV_16UC1 of the frame's size, 0 = nothing
  std::vector<Instance> instances;
};

// ---------------------------------------------------------------------------------------------- slam -> objects

enum class TrackingState { kInitialising, kTracking, kLost, kRelocalised };

// A sparse map point as of now.
struct MapPoint {
  MapPointId id;
  Eigen::Vector3d position_world;  // map units
  int observations = 0;            // keyframes that saw it
  double max_parallax_rad = 0;     // largest angle between two rays to it
};

// Sight of a map point in one keyframe.
struct PointObservation {
  MapPointId point;
  Eigen::Vector2f pixel_px;
  uint16_t label = 0;  // of that keyframe's mask under the pixel, 0 = none
};

// A frame whose camera pose is known, handed to objects in frame order.
struct TrackedFrame {
  std::shared_ptr<const Frame> frame;
  TrackingState state = TrackingState::kTracking;
  SE3<World, Camera> T_world_camera;
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();  // unit length, against gravity
  bool is_keyframe = false;
  // The keyframe the pose hangs on: T_world_camera = T_world_reference * T_reference_camera as of now; when the
  // reference is corrected the frame goes along. The translation is in the reference's first unit of length: it is to
  // be multiplied by all scale corrections the reference went through. 0: the pose was given and hangs on nothing.
  KeyframeId reference = {};
  SE3<Camera, Camera> T_reference_camera = {};
  std::string reason = {};  // for people: why not tracking; empty while tracking
};

// A keyframe with what the sparse map says about it. `points` holds the present position of every point in
// `observations`; points move when later keyframes refine them.
struct KeyframeView {
  KeyframeId id;
  std::shared_ptr<const Frame> frame;
  SE3<World, Camera> T_world_camera;
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();
  std::vector<PointObservation> observations;
  std::vector<MapPoint> points;
  std::vector<MapPointId> removed_points;  // culled since the last keyframe
};

// What became of one keyframe since it was last told of.
struct KeyframeCorrection {
  KeyframeId id;
  SE3<World, Camera> T_world_camera;  // now
  // What happened to the space around it: p_new = S_new_old * p_old. Its rotation and the motion of the camera's centre
  // are those of the pose; its scale is 1 unless a monocular map changed its scale here.
  Sim3<World, World> S_new_old;
};

// The map moved under what was already handed on: bundle adjustment, a closed loop, gravity, scale.
struct MapCorrection {
  std::vector<KeyframeCorrection> keyframes;  // those that moved noticeably, by id
  std::vector<MapPoint> points;               // those that moved, with their new positions
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();
};

// ---------------------------------------------------------------------------------------------- objects -> session

enum class ObjectState { kProvisional, kConfirmed, kLost };

// A cuboid: |x|,|y|,|z| <= half_extents in the Object frame.
struct Cuboid {
  SE3<World, Object> T_world_object;                       // z axis = up_world; x axis = yaw
  Eigen::Vector3d half_extents = Eigen::Vector3d::Zero();  // map units
  double confidence = 0;                                   // 0..1
};

struct ObjectUpdate {
  ObjectId id;
  uint64_t revision = 0;  // grows with every update of this object, over cuboid and mesh alike
  ObjectState state = ObjectState::kProvisional;
  std::string class_name;
  double class_score = 0;  // share of the evidence that says class_name, 0..1
  Cuboid cuboid;
  uint64_t observations = 0;  // frames in which it was seen
  // Where the newest mesh stands: the pose of the frame its vertices are in. It follows corrections of the map, so that
  // a mesh that was sent once need not be sent again. None while there is no mesh.
  std::optional<SE3<World, Object>> T_world_mesh;
  // p_world = T_world_mesh * (mesh_scale * vertex): 1 until a correction changes the scale of a monocular map.
  double mesh_scale = 1;
};

struct ObjectRemoved {
  ObjectId id;
  uint64_t revision = 0;
  std::string reason;
};

// `from` was found to be `into` and is gone; its observations count for `into` from now on.
struct ObjectMerged {
  ObjectId from;
  ObjectId into;
  uint64_t revision = 0;  // of `into`, which it is at from now on
};

// ---------------------------------------------------------------------------------------------- objects -> nerf

enum class RayKind : uint8_t { kBackground = 0, kObject = 1, kOccluder = 2 };

// One training view of one object: a crop of a keyframe. Pixels outside the crop are unknown.
struct ObjectView {
  ObjectId object;
  KeyframeId keyframe;
  CameraModel camera;  // of the full image, no distortion
  SE3<World, Camera> T_world_camera;
  cv::Rect roi_px;    // the crop in the full image
  cv::Mat color_bgr;  // CV_8UC3, size of roi
  cv::Mat ray_kind;   // CV_8UC1 of RayKind, size of roi
  cv::Mat depth_mu;   // CV_32FC1 z depth, 0 = none, size of roi; empty = none at all (dense depth)
  std::vector<Eigen::Vector3f>
      sparse_depth;  // (u_px, v_px, z_mu) in full-image pixels: map points of this object seen here
};

// The corrected pose of a view that was sent before.
struct ViewPose {
  KeyframeId keyframe;
  SE3<World, Camera> T_world_camera;
};

// What objects tells nerf about one object: its box (always), views that are new, and how the map moved under the old
// ones. The correction comes first: box and new views are in the corrected world.
struct ObjectViews {
  ObjectId object;
  std::optional<Sim3<World, World>> S_new_old =
      {};                                      // of the space the object stands in: its field goes along unchanged
  std::vector<ViewPose> corrected_views = {};  // in the corrected world
  Cuboid cuboid;                               // training box before enlargement; may be larger than the told one
  std::vector<ObjectView> new_views = {};
};

// ---------------------------------------------------------------------------------------------- nerf -> mesh

// A trained field that can be asked. Immutable and safe to share between threads.
class FieldSampler {
 public:
  virtual ~FieldSampler() = default;
  // raw[i] = how much p_object[i] (Object frame, map units) is inside, in the field's own unit (a log density, a signed
  // distance ..): it grows inwards, and the surface is where it crosses FieldSnapshot::surface_level. What else it
  // means is for SurfaceOptics to say. Points outside the box get -inf-like -1e4. rgb may be empty (not asked for) or
  // as long as p_object.
  virtual void Sample(std::span<const Eigen::Vector3f> p_object, std::span<float> raw, std::span<Rgb8> rgb) const = 0;
};

// What raw values mean to light. On the outer side of the surface and close to it the density (optical depth per map
// unit) is
//   density(raw) = surface_density_per_mu * exp((raw - surface_level) / raw_per_efold).
// For a field of log density this is exact with raw_per_efold 1; for a signed distance whose density is a Laplace or
// logistic distribution's (Yariv et al. 2021, Wang et al. 2021) raw_per_efold is that distribution's scale.
struct SurfaceOptics {
  float surface_density_per_mu = 0;  // > 0
  float raw_per_efold = 1;           // > 0
};

// One training view, for those who ask what it saw of the object.
struct TrainingCamera {
  SE3<Camera, Object> T_camera_object;  // map units
  CameraModel camera;                   // of the full image, no distortion
  cv::Rect roi_px;                      // the crop in the full image; the view knows nothing of pixels outside it
  cv::Mat ray_kind;                     // CV_8UC1 of RayKind, size of roi
};

// Bits over a regular grid of the box: cell (x, y, z) at index (z * resolution + y) * resolution + x covers the box
// evenly, from -box_half_extents to +box_half_extents.
struct OccupancyBits {
  int resolution = 0;
  std::vector<uint8_t> bits;  // 1 = may hold matter
};

struct FieldSnapshot {
  ObjectId object;
  uint64_t steps = 0;        // optimisation steps done
  double train_seconds = 0;  // wall time inside training slices
  double loss = 0;           // mean colour loss of the last slice
  int views = 0;
  // All that corrections did to the object's space since its first ObjectViews. Whoever knows of later ones can tell
  // from it how to move what is made of this snapshot.
  Sim3<World, World> S_new_first;
  bool converged = false;  // the pool will not train it further unless a new view comes
  std::string concern;     // for people: what is wrong with what the object was given; empty = nothing
  SE3<World, Object> T_world_object;
  Eigen::Vector3f box_half_extents = Eigen::Vector3f::Zero();  // of the trained box (cuboid enlarged), map units
  float surface_level = 0;                                     // of raw, see FieldSampler
  SurfaceOptics optics;
  // A component of inside cells that hangs together through values above this lower level is one piece (thin parts).
  float connect_level = 0;
  OccupancyBits hull;                   // visual hull of the masks: outside it nothing can be
  std::vector<TrainingCamera> cameras;  // the training views
  std::shared_ptr<const FieldSampler> field;
};

// ---------------------------------------------------------------------------------------------- mesh -> outbox

struct MeshUpdate {
  ObjectId id;
  uint64_t revision = 0;  // of the object; the newest wins
  uint64_t steps = 0;     // training steps behind it
  double train_seconds = 0;
  bool final = false;  // no better mesh comes unless the object is seen anew
  uint32_t vertex_count = 0;
  uint32_t triangle_count = 0;
  std::string draco;  // Draco (edgebreaker) bytes; vertices in the Object frame, map units; see common/mesh_codec.h
};

// ---------------------------------------------------------------------------------------------- session -> client

struct FrameAck {
  uint64_t frame_id = 0;
  bool accepted = true;
  std::string error;  // why not accepted
  TrackingState state = TrackingState::kInitialising;
  std::optional<SE3<World, Camera>> T_world_camera;
  bool is_keyframe = false;
  double latency_s = 0;           // from arrival at the server to this acknowledgement
  std::string state_reason = {};  // for people: why the state is not kTracking, e.g. "too little parallax"
};

// Answer to one MasksInput.
struct MasksAck {
  uint64_t frame_id = 0;
  bool accepted = true;
  std::string error;  // why not accepted
};

struct Statistics {
  uint64_t frames_received = 0;
  uint64_t frames_processed = 0;
  uint64_t frames_dropped = 0;  // live mode under load
  uint64_t frames_rejected = 0;
  uint64_t keyframes = 0;
  uint64_t map_points = 0;
  uint64_t objects = 0;           // confirmed
  uint64_t objects_training = 0;  // with training work left
  uint64_t training_steps = 0;
  double training_progress = 0;  // 0..1 over all objects
  uint64_t resident_bytes = 0;   // of the server process
};

using MapEvent = std::variant<FrameAck, ObjectUpdate, MeshUpdate, ObjectRemoved, ObjectMerged, Statistics, MasksAck>;

}  // namespace romap
