#include "server/store/session_transfer.h"

#include <algorithm>
#include <utility>

#include "common/status.h"
#include "common/unix_time.h"
#include "common/wire/sessions.h"
#include "romap/v1/mapping.pb.h"
#include "server/store/blob_content.h"
#include "server/store/session_file.h"

namespace romap::store {
namespace {

constexpr size_t kPieceBytes = 1 << 20;

// Collects records to pieces.
class PieceWriter {
 public:
  explicit PieceWriter(const std::function<absl::Status(std::string)>& write)
      : write_(write), piece_(SessionFileHeader()) {}

  absl::Status Add(FileRecord kind, const std::string& content) {
    piece_ += SessionFileRecord(kind, content);
    return piece_.size() >= kPieceBytes ? Flush() : absl::OkStatus();
  }
  absl::Status Flush() { return piece_.empty() ? absl::OkStatus() : write_(std::exchange(piece_, "")); }

 private:
  const std::function<absl::Status(std::string)>& write_;
  std::string piece_;
};

absl::Status InvalidRecord(const absl::Status& why) { return InvalidArgument("the session file: {}", Message(why)); }

// Writes the records of a file to the store.
class SessionImport {
 public:
  SessionImport(Store& store, const std::string& id, std::string tenant) : store_(store), tenant_(std::move(tenant)) {
    session_.id = id;
    session_.complete = false;
  }

  absl::Status Add(FileRecord kind, std::string content) {
    if (kind == FileRecord::kSession) return AddOptions(content);
    if (session_.options.camera.width_px == 0) return InvalidArgument("the session file does not start with a session");
    switch (kind) {
      case FileRecord::kState:
        return AddState(content);
      case FileRecord::kInput: {
        auto input = ParseInput(content);
        if (!input.ok()) return InvalidRecord(input.status());
        ++session_.inputs;
        store_.AppendInput(session_.id, *std::move(input), /*may_wait=*/true);
        return absl::OkStatus();
      }
      case FileRecord::kObject: {
        auto object = ParseObject(content);
        if (!object.ok()) return InvalidRecord(object.status());
        store_.PutObject(session_.id, *std::move(object));
        return absl::OkStatus();
      }
      case FileRecord::kMesh: {
        auto mesh = ParseMesh(content);
        if (!mesh.ok()) return InvalidRecord(mesh.status());
        store_.PutMesh(session_.id, *std::move(mesh));
        return absl::OkStatus();
      }
      case FileRecord::kTrajectory: {
        std::vector<FrameAck> frames;
        std::vector<int64_t> timestamps_ns;
        if (const absl::Status parsed = ParseTrajectory(content, &frames, &timestamps_ns); !parsed.ok()) {
          return InvalidRecord(parsed);
        }
        store_.PutTrajectory(session_.id, std::move(frames), std::move(timestamps_ns));
        return absl::OkStatus();
      }
      default:
        return absl::OkStatus();
    }
  }

  bool created() const { return created_; }
  const StoredSession& session() const { return session_; }

 private:
  absl::Status AddOptions(const std::string& content) {
    v1::CreateSessionRequest proto;
    if (!proto.ParseFromString(content)) return InvalidArgument("the session file: its session cannot be parsed");
    auto options = wire::FromProto(proto);
    if (!options.ok()) return InvalidRecord(options.status());
    if (const absl::Status valid = ValidateCameraModel(options->camera); !valid.ok()) return InvalidRecord(valid);
    session_.options = *std::move(options);
    session_.options.tenant = tenant_;
    return absl::OkStatus();
  }

  absl::Status AddState(const std::string& content) {
    v1::SessionInfo proto;
    if (!proto.ParseFromString(content)) return InvalidArgument("the session file: its state cannot be parsed");
    auto info = wire::FromProto(proto, "state");
    if (!info.ok()) return InvalidRecord(info.status());
    // A session that was finishing when it was saved can be continued.
    session_.state = HasEnded(info->state) ? info->state : SessionState::kOpen;
    session_.created_unix_ns = info->created_unix_ns;
    session_.used_unix_ns = UnixNow_ns();
    session_.statistics = info->statistics;
    ROMAP_RETURN_IF_ERROR(store_.Create(session_));
    created_ = true;
    return absl::OkStatus();
  }

  Store& store_;
  const std::string tenant_;
  StoredSession session_;
  bool created_ = false;
};

}  // namespace

absl::Status SaveSession(const Store& store, const std::string& session,
                         const std::function<absl::Status(std::string piece)>& write) {
  ROMAP_ASSIGN_OR_RETURN(const std::vector<StoredSession> sessions, store.Sessions());
  const auto found = std::find_if(sessions.begin(), sessions.end(),
                                  [&](const StoredSession& candidate) { return candidate.id == session; });
  if (found == sessions.end()) return NotFound("session '{}' is not stored", session);
  PieceWriter writer(write);
  ROMAP_RETURN_IF_ERROR(writer.Add(FileRecord::kSession, wire::ToProto(found->options).SerializeAsString()));
  ROMAP_RETURN_IF_ERROR(writer.Add(FileRecord::kState, wire::ToProto(InfoOf(*found)).SerializeAsString()));
  for (uint64_t number = 1; number <= found->inputs; ++number) {
    ROMAP_ASSIGN_OR_RETURN(const SessionInput input, store.LoadInput(session, number));
    ROMAP_RETURN_IF_ERROR(writer.Add(FileRecord::kInput, InputContent(input)));
  }
  ROMAP_ASSIGN_OR_RETURN(const StoredMap map, store.LoadMap(session));
  if (!map.damage.empty()) return absl::DataLossError("the stored session is damaged: " + map.damage.front());
  for (const ObjectSnapshot& object : map.objects) {
    ROMAP_RETURN_IF_ERROR(writer.Add(FileRecord::kObject, ObjectContent(object.object)));
    if (object.mesh) ROMAP_RETURN_IF_ERROR(writer.Add(FileRecord::kMesh, MeshContent(*object.mesh)));
  }
  ROMAP_RETURN_IF_ERROR(writer.Add(FileRecord::kTrajectory, TrajectoryContent(map.trajectory, map.timestamps_ns)));
  ROMAP_RETURN_IF_ERROR(writer.Add(FileRecord::kEnd, ""));
  return writer.Flush();
}

absl::StatusOr<StoredSession> LoadSession(Store& store, const std::string& new_id, const std::string& tenant,
                                          const std::function<absl::StatusOr<std::string>()>& read) {
  SessionImport import(store, new_id, tenant);
  SessionFileReader reader([&](FileRecord kind, std::string content) { return import.Add(kind, std::move(content)); });
  const auto load = [&]() -> absl::Status {
    while (true) {
      ROMAP_ASSIGN_OR_RETURN(const std::string piece, read());
      if (piece.empty()) break;
      ROMAP_RETURN_IF_ERROR(reader.Add(piece));
    }
    ROMAP_RETURN_IF_ERROR(reader.End());
    if (!import.created()) return InvalidArgument("the session file has no session");
    return store.Complete(new_id);
  };
  const absl::Status loaded = load();
  if (loaded.ok()) return import.session();
  if (import.created()) store.Remove(new_id).IgnoreError();
  return loaded;
}

}  // namespace romap::store
