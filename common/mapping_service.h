#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/camera_model.h"
#include "common/client_input.h"
#include "common/map_events.h"

namespace romap {

enum class SessionState {
  kOpen,       // accepts frames
  kFinishing,  // accepts no more frames; processing and training continue
  kFinished,   // all processing and training is complete
  kFailed,     // ended by an internal error; the map up to then can be exported
  kRestoring,  // read from the store after a restart; its stored map can be watched and exported
};

enum class FrameMode {
  kReplay,  // lossless: a full input queue blocks the sender
  kLive,    // a full input queue drops its oldest frame
};

struct SessionOptions {
  std::string name;  // display name; may be empty
  CameraModel camera;
  FrameMode mode = FrameMode::kReplay;
  PoseUse pose_use = PoseUse::kGiven;
  // Up in the world of the client's poses, of any length > 0. nullopt: against the gravity that the client sends, else
  // z.
  std::optional<Eigen::Vector3d> up_world = {};
  // Without `up_world` and gravity: estimate up in the world of the client's poses from the images instead.
  bool estimate_up = false;
  // Who owns the session, see server/access. Set by the server, never by the client; empty without access control.
  std::string tenant = {};
};

struct SessionInfo {
  std::string id;    // assigned by the service
  std::string name;  // as given in SessionOptions
  CameraModel camera;
  FrameMode mode = FrameMode::kReplay;
  SessionState state = SessionState::kOpen;
  int64_t created_unix_ns = 0;  // nanoseconds since the Unix epoch
  bool stream_open = false;     // a client has an open Map stream
  Statistics statistics;
  bool durable = false;       // the service stores the session
  bool pinned = false;        // see MappingService::PinSession()
  uint64_t stored_bytes = 0;  // on the disk
  std::string tenant = {};    // as in SessionOptions
};

// The current state of one object.
struct ObjectSnapshot {
  ObjectUpdate object;             // cuboid in the World frame, map units
  std::optional<MeshUpdate> mesh;  // absent until the first mesh is extracted
};

// The map of a session at one instant.
struct MapSnapshot {
  std::string session_id;
  SessionState state = SessionState::kOpen;
  std::vector<ObjectSnapshot> objects;  // confirmed and lost objects, in ascending order of id
  std::vector<FrameAck> trajectory;     // one entry per accepted frame with a pose, in ascending order of frame_id
  std::vector<int64_t> timestamps_ns;   // capture times of `trajectory`, same length
  Statistics statistics;
};

// Points of the sparse map that the camera is tracked against.
struct SparsePoints {
  uint64_t revision = 0;                         // increases with every change; 0: there was no map yet
  SparseMapId map_id = {};                       // the map that the points belong to; 0: none
  std::vector<Eigen::Vector3f> positions_world;  // map units, in no order
};

// A camera image as a session processed it: without the distortion of the lens.
struct CameraImage {
  uint64_t frame_id = 0;
  std::string jpeg;
};

// What a service says when it opens a stream.
struct StreamOpening {
  std::string resume_token;  // map streams only: lets OpenMap() replace this stream
  bool durable = false;      // accepted inputs are stored; Durable events say up to which
  // The objects of the map, whose events follow first. No other object exists any longer.
  std::vector<ObjectId> objects;
  std::optional<uint64_t> newest_frame_id;  // of the frames that the session accepted
};

// The events of one subscription. Cancel() may be called while another thread waits in Next().
class EventStream {
 public:
  virtual ~EventStream() = default;
  virtual const StreamOpening& opening() const = 0;
  // Waits up to `timeout` for the next event. Returns nullopt on timeout or when the stream has ended (see Done()).
  virtual std::optional<MapEvent> Next(std::chrono::milliseconds timeout) = 0;
  // True once the stream has ended and all of its events have been returned.
  virtual bool Done() const = 0;
  // OK while the stream is open and after a regular end; otherwise the reason why the stream ended.
  virtual absl::Status status() const = 0;
  // Ends the stream. Pending events are discarded.
  virtual void Cancel() = 0;
};

// The bidirectional stream of the client that feeds a session: frames and masks in, events out.
class MapStream : public EventStream {
 public:
  // Sends a frame. Blocks while the service applies back pressure. A frame with invalid content is reported by a
  // FrameAck with accepted = false, and the stream stays usable. A non-OK status means that the stream has ended.
  virtual absl::Status Send(FrameInput frame) = 0;
  // Sends the masks of an earlier frame that was sent without masks. Blocks and fails like Send(); reported by a
  // MasksAck.
  virtual absl::Status SendMasks(MasksInput masks) = 0;
  // Ends sending. Events continue until all accepted frames and masks are processed; then the stream ends with OK.
  // FAILED_PRECONDITION if sending has already ended.
  virtual absl::Status CloseSend() = 0;
};

// The mapping API. Implemented in process (server/session/local_mapping_service.h) and over gRPC
// (client/sdk/remote_mapping_service.h). Thread-safe.
//
// Methods that take a session_id return NOT_FOUND if no such session exists.
class MappingService {
 public:
  virtual ~MappingService() = default;
  // Creates an empty session. INVALID_ARGUMENT: invalid camera. RESOURCE_EXHAUSTED: session limit reached.
  virtual absl::StatusOr<SessionInfo> CreateSession(const SessionOptions& options) = 0;
  // Returns all sessions.
  virtual absl::StatusOr<std::vector<SessionInfo>> ListSessions() = 0;
  virtual absl::StatusOr<SessionInfo> GetSession(const std::string& session_id) = 0;
  // Ends the input of a session: accepted frames are still processed, and every object is trained to completion.
  // Returns immediately. The state changes to kFinishing and later to kFinished, which ends all open event streams.
  virtual absl::StatusOr<SessionInfo> FinishSession(const std::string& session_id) = 0;
  // Deletes a session and its map.
  virtual absl::Status DeleteSession(const std::string& session_id) = 0;
  // Opens the stream that feeds a session. With the `resume_token` of an earlier stream of the session, ends that
  // stream if it is still open. FAILED_PRECONDITION: the session already has another open Map stream or accepts no more
  // frames. UNAVAILABLE: the session is being restored; try again.
  virtual absl::StatusOr<std::unique_ptr<MapStream>> OpenMap(const std::string& session_id,
                                                             const std::string& resume_token) = 0;
  absl::StatusOr<std::unique_ptr<MapStream>> OpenMap(const std::string& session_id) { return OpenMap(session_id, ""); }
  // Subscribes to the events of a session: first the current state of all objects, then every change.
  virtual absl::StatusOr<std::unique_ptr<EventStream>> Watch(const std::string& session_id) = 0;
  // Returns the map of a session, in any state.
  virtual absl::StatusOr<MapSnapshot> ExportMap(const std::string& session_id) = 0;

  // For viewers of a service in the same process; over gRPC UNIMPLEMENTED. They do not delay the session.
  //
  // At most kMaxSparsePoints points, evenly chosen, as of the last half second. None while the session is not in
  // memory.
  static constexpr size_t kMaxSparsePoints = 20'000;
  virtual absl::StatusOr<SparsePoints> Points(const std::string& session_id);
  // The newest tracked image, scaled so that its sides are at most `max_side_px` (>= 16). NOT_FOUND: none since the
  // session is in memory.
  virtual absl::StatusOr<CameraImage> NewestImage(const std::string& session_id, int max_side_px);

  // Only for services that store sessions; otherwise FAILED_PRECONDITION.
  using PieceWriter = std::function<absl::Status(std::string piece)>;
  using PieceReader = std::function<absl::StatusOr<std::string>()>;  // the next piece; empty at the end
  // Passes the session to `write` as one file (*.romap). Errors of `write` are returned. DATA_LOSS: it is damaged.
  virtual absl::Status SaveSession(const std::string& session_id, const PieceWriter& write) = 0;
  // Adds the session of a file with another id. `tenant`: as in SessionOptions. INVALID_ARGUMENT: the file is damaged
  // or cut off; nothing is added.
  virtual absl::StatusOr<SessionInfo> LoadSession(const PieceReader& read, const std::string& tenant) = 0;
  absl::StatusOr<SessionInfo> LoadSession(const PieceReader& read) { return LoadSession(read, ""); }
  // A pinned session is not deleted by age or size.
  virtual absl::StatusOr<SessionInfo> PinSession(const std::string& session_id, bool pinned) = 0;
};

inline absl::StatusOr<SparsePoints> MappingService::Points(const std::string& /*session_id*/) {
  return absl::UnimplementedError("this service does not send the points of the sparse map");
}
inline absl::StatusOr<CameraImage> MappingService::NewestImage(const std::string& /*session_id*/, int /*max_side_px*/) {
  return absl::UnimplementedError("this service does not send images");
}

}  // namespace romap
