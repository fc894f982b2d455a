#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/camera_model.h"
#include "common/client_input.h"
#include "common/map_events.h"

namespace romap {

enum class SessionState { kOpen, kFinishing, kFinished, kFailed };
enum class FrameMode {
  kReplay /* lossless: a full queue pushes back */,
  kLive /* the oldest waiting frame is dropped */
};

struct SessionOptions {
  std::string name;  // for people; may be empty
  CameraModel camera;
  FrameMode mode = FrameMode::kReplay;
  PoseUse pose_use = PoseUse::kGiven;
};

struct SessionInfo {
  std::string id;
  std::string name;
  CameraModel camera;
  FrameMode mode = FrameMode::kReplay;
  SessionState state = SessionState::kOpen;
  int64_t created_unix_ns = 0;
  bool stream_open = false;  // a Map stream is attached
  Statistics statistics;
};

// One object with everything a newcomer needs: what ExportMap returns and Watch begins with.
struct ObjectSnapshot {
  ObjectUpdate object;
  std::optional<MeshUpdate> mesh;
};

struct MapSnapshot {
  std::string session_id;
  SessionState state = SessionState::kOpen;
  std::vector<ObjectSnapshot> objects;  // confirmed and lost ones, by id
  std::vector<FrameAck> trajectory;     // one entry per accepted frame with a pose, by frame id
  std::vector<int64_t> timestamps_ns;   // of `trajectory`
  Statistics statistics;
};

// Server-to-client events of one subscription. Thread-safe between Next() and Cancel().
class EventStream {
 public:
  virtual ~EventStream() = default;
  // Waits up to `timeout` for the next event. nullopt: none came in time, or the stream has ended (see Done()).
  virtual std::optional<MapEvent> Next(std::chrono::milliseconds timeout) = 0;
  virtual bool Done() const = 0;
  // OK while open or after a clean end; otherwise why the stream broke.
  virtual absl::Status status() const = 0;
  virtual void Cancel() = 0;
};

// The bidirectional stream of the client that owns the session: frames and late masks in, events out.
class MapStream : public EventStream {
 public:
  // Blocks while the server pushes back. A frame that is bad in itself is answered with a FrameAck{accepted=false} and
  // the stream lives on; a non-OK status here means the stream is over.
  virtual absl::Status Send(FrameInput frame) = 0;
  // The masks of a frame that was sent before, without any. Blocks and fails as Send(); answered with a MasksAck.
  virtual absl::Status SendMasks(MasksInput masks) = 0;
  // No more frames and masks on this stream. Events keep coming until those that were accepted are processed, then the
  // stream ends.
  virtual absl::Status CloseSend() = 0;
};

// All that romap can do for a client. Implemented in process (server/session) and over gRPC (client/sdk).
class MappingService {
 public:
  virtual ~MappingService() = default;
  // INVALID_ARGUMENT: bad camera. RESOURCE_EXHAUSTED: too many sessions.
  virtual absl::StatusOr<SessionInfo> CreateSession(const SessionOptions& options) = 0;
  virtual absl::StatusOr<std::vector<SessionInfo>> ListSessions() = 0;
  virtual absl::StatusOr<SessionInfo> GetSession(const std::string& session_id) = 0;  // NOT_FOUND
  // No more frames will come: processes what was accepted and trains every object to its end. Returns at once; the
  // state goes kFinishing -> kFinished and open event streams end when it is reached.
  virtual absl::StatusOr<SessionInfo> FinishSession(const std::string& session_id) = 0;
  virtual absl::Status DeleteSession(const std::string& session_id) = 0;
  // NOT_FOUND; FAILED_PRECONDITION when the session has a Map stream already or is finished.
  virtual absl::StatusOr<std::unique_ptr<MapStream>> OpenMap(const std::string& session_id) = 0;
  // First the objects there are, then every change.
  virtual absl::StatusOr<std::unique_ptr<EventStream>> Watch(const std::string& session_id) = 0;
  virtual absl::StatusOr<MapSnapshot> ExportMap(const std::string& session_id) = 0;
};

}  // namespace romap
