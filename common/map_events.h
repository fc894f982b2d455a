#pragma once

// What a session sends to its clients, as plain values. The wire form is proto/romap/v1/mapping.proto.

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/cuboid.h"
#include "common/diagnostic.h"
#include "common/geometry.h"
#include "common/ids.h"
#include "common/mesh.h"
#include "common/pose_uncertainty.h"

namespace romap {

enum class TrackingState { kInitializing, kTracking, kLost, kRelocalized };
enum class ObjectState { kProvisional, kConfirmed, kLost };

// The result of one frame.
struct FrameAck {
  uint64_t frame_id = 0;
  bool accepted = true;
  std::string error;  // why the frame was rejected; empty if it was accepted
  TrackingState state = TrackingState::kInitializing;
  std::optional<SE3<World, Camera>> T_world_camera;  // nullopt: not tracked
  bool is_keyframe = false;
  double latency_s = 0;           // from arrival at the server to this acknowledgement
  std::string state_reason = {};  // human-readable: why the state is not kTracking, e.g. "too little parallax"
  // Of T_world_camera, as known when it was computed. nullopt: not tracked, or the pose was given by the client.
  std::optional<PoseUncertainty> uncertainty = {};
  // The rotation of T_world_camera where only the translation is unknown, see the proto.
  std::optional<Eigen::Quaterniond> R_world_camera = {};
  // The map that T_world_camera refers to; 0: none. The worlds of two maps are not related to each other.
  SparseMapId map_id = {};
  // The frame was sent again, and the session accepted it before. Then only frame_id and accepted are set.
  bool duplicate = false;
};

// The result of one MasksInput.
struct MasksAck {
  uint64_t frame_id = 0;
  bool accepted = true;
  std::string error = {};  // why the masks were rejected; empty if they were accepted
  bool duplicate = false;  // as in FrameAck
};

// All accepted inputs up to these are stored: they survive a crash of the server. 0: none.
struct Durable {
  uint64_t frame_id = 0;        // frames with ids up to this one
  uint64_t masks_frame_id = 0;  // late masks of frames with ids up to this one
};

struct ObjectUpdate {
  ObjectId id;
  uint64_t revision = 0;  // increases with every change of this object: cuboid, mesh, merge or removal
  ObjectState state = ObjectState::kProvisional;
  std::string class_name;
  double class_score = 0;  // share of the detections, weighted by score, that support class_name, 0..1
  Cuboid cuboid;
  uint64_t observations = 0;  // number of frames in which the object was detected
  // Pose of the mesh frame; nullopt while there is no mesh. It follows corrections of the map, so that a mesh that was
  // already sent need not be sent again.
  std::optional<SE3<World, Object>> T_world_mesh;
  // p_world = T_world_mesh * (mesh_scale * vertex). 1 until a correction changes the scale of a monocular map.
  double mesh_scale = 1;
  // The map that the object belongs to. When two maps are merged, the objects of one of them are published again.
  SparseMapId map_id = {};
};

// Where a camera would see most of the surface of an object that has been observed badly so far.
struct NextView {
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  // mesh frame: from the object to the camera, unit length
  double gain = 0;                                      // share of the surface that is badly observed and visible there
};

// A simpler version of a mesh.
struct MeshLevel {
  std::string draco;  // as MeshUpdate::draco, with the same frame and texture
  uint32_t triangle_count = 0;
  double error_mu = 0;  // about the largest distance between its surface and that of the mesh
};

struct MeshUpdate {
  ObjectId id;
  uint64_t revision = 0;     // of the object; the highest one is current
  uint64_t steps = 0;        // training steps of the field it was extracted from
  double train_seconds = 0;  // wall time of those steps
  bool final = false;        // no better mesh follows unless the object is observed again
  uint32_t vertex_count = 0;
  uint32_t triangle_count = 0;
  std::string draco;  // Draco (edgebreaker) bytes; vertices in the mesh frame, map units; see common/mesh_codec.h
  MeshTexture texture = {};            // final meshes only; the Draco mesh has texture coordinates then
  std::vector<MeshLevel> levels = {};  // final meshes only; each has about a quarter of the triangles of the one before
  std::optional<NextView> next_view = {};  // nullopt: no view would add much
};

struct ObjectRemoved {
  ObjectId id;
  uint64_t revision = 0;
  std::string reason;
};

// `from` was merged into `into`, because both are the same object; `into` takes over its observations.
struct ObjectMerged {
  ObjectId from;
  ObjectId into;
  uint64_t revision = 0;  // new revision of `into`
};

// Counters of one session since it was created, and what is wrong with its input and map.
struct Statistics {
  uint64_t frames_received = 0;
  uint64_t frames_processed = 0;
  uint64_t frames_dropped = 0;   // dropped in live mode because the server was too busy
  uint64_t frames_rejected = 0;  // malformed frames
  uint64_t keyframes = 0;
  uint64_t map_points = 0;
  uint64_t objects = 0;           // confirmed
  uint64_t objects_training = 0;  // with training steps left
  uint64_t training_steps = 0;
  double training_progress = 0;  // 0..1 over all objects
  uint64_t resident_bytes = 0;   // of the server process
  std::vector<Diagnostic> diagnostics = {};
};

using MapEvent = std::variant<FrameAck, ObjectUpdate, MeshUpdate, ObjectRemoved, ObjectMerged, Statistics, MasksAck,
                              Diagnostic, Durable>;

}  // namespace romap
