#include "common/wire/sessions.h"

#include <algorithm>
#include <utility>

#include "common/status.h"
#include "common/wire/enums.h"
#include "common/wire/events.h"
#include "common/wire/geometry.h"

namespace romap::wire {
namespace {

// Without this, the overload below would hide the public ones.
using wire::FromProto;

// About 200 bytes per point, so that a part stays far below the message limit.
constexpr size_t kTrajectoryPointsPerPart = 4096;

absl::StatusOr<ObjectSnapshot> FromProto(v1::ObjectSnapshot proto, const std::string& where) {
  if (!proto.has_object()) return InvalidArgument("{}.object: missing", where);
  ObjectSnapshot snapshot;
  ROMAP_ASSIGN_OR_RETURN(snapshot.object, FromProto(std::move(*proto.mutable_object()), where + ".object"));
  if (proto.has_mesh()) {
    ROMAP_ASSIGN_OR_RETURN(snapshot.mesh, FromProto(std::move(*proto.mutable_mesh()), where + ".mesh"));
  }
  return snapshot;
}

}  // namespace

v1::CreateSessionRequest ToProto(const SessionOptions& options) {
  v1::CreateSessionRequest proto;
  proto.set_name(options.name);
  *proto.mutable_camera() = ToProto(options.camera);
  proto.set_mode(EnumToProto(kFrameModes, options.mode));
  proto.set_pose_use(EnumToProto(kPoseUses, options.pose_use));
  if (options.up_world) *proto.mutable_up_world() = ToProto(*options.up_world);
  proto.set_estimate_up(options.estimate_up);
  return proto;
}

absl::StatusOr<SessionOptions> FromProto(const v1::CreateSessionRequest& proto) {
  if (!proto.has_camera()) return InvalidArgument("camera: missing");
  SessionOptions options;
  options.name = proto.name();
  ROMAP_ASSIGN_OR_RETURN(options.camera, CameraFromProto(proto.camera(), "camera"));
  ROMAP_ASSIGN_OR_RETURN(options.mode, EnumFromProto(kFrameModes, proto.mode(), "mode"));
  ROMAP_ASSIGN_OR_RETURN(options.pose_use, EnumFromProto(kPoseUses, proto.pose_use(), "pose_use"));
  if (proto.has_up_world()) {
    ROMAP_ASSIGN_OR_RETURN(options.up_world, VectorFromProto(proto.up_world(), "up_world"));
    if (!(options.up_world->norm() > 0)) return InvalidArgument("up_world: is zero; expected a direction");
  }
  options.estimate_up = proto.estimate_up();
  return options;
}

v1::SessionInfo ToProto(const SessionInfo& info) {
  v1::SessionInfo proto;
  proto.set_id(info.id);
  proto.set_name(info.name);
  *proto.mutable_camera() = ToProto(info.camera);
  proto.set_mode(EnumToProto(kFrameModes, info.mode));
  proto.set_state(EnumToProto(kSessionStates, info.state));
  proto.set_created_unix_ns(info.created_unix_ns);
  proto.set_stream_open(info.stream_open);
  *proto.mutable_statistics() = ToProto(info.statistics);
  proto.set_durable(info.durable);
  proto.set_pinned(info.pinned);
  proto.set_stored_bytes(info.stored_bytes);
  proto.set_tenant(info.tenant);
  return proto;
}

absl::StatusOr<SessionInfo> FromProto(const v1::SessionInfo& proto, const std::string& where) {
  if (proto.id().empty()) return InvalidArgument("{}.id: missing", where);
  if (!proto.has_camera()) return InvalidArgument("{}.camera: missing", where);
  SessionInfo info;
  info.id = proto.id();
  info.name = proto.name();
  ROMAP_ASSIGN_OR_RETURN(info.camera, CameraFromProto(proto.camera(), where + ".camera"));
  ROMAP_ASSIGN_OR_RETURN(info.mode, EnumFromProto(kFrameModes, proto.mode(), where + ".mode"));
  ROMAP_ASSIGN_OR_RETURN(info.state, EnumFromProto(kSessionStates, proto.state(), where + ".state"));
  info.created_unix_ns = proto.created_unix_ns();
  info.stream_open = proto.stream_open();
  ROMAP_ASSIGN_OR_RETURN(info.statistics, FromProto(proto.statistics(), where + ".statistics"));
  info.durable = proto.durable();
  info.pinned = proto.pinned();
  info.stored_bytes = proto.stored_bytes();
  info.tenant = proto.tenant();
  return info;
}

v1::StreamOpened ToProto(const std::string& session_id, StreamOpening opening) {
  v1::StreamOpened proto;
  proto.set_session_id(session_id);
  proto.set_resume_token(std::move(opening.resume_token));
  proto.set_durable(opening.durable);
  for (const ObjectId object : opening.objects) proto.add_object_ids(object.value);
  if (opening.newest_frame_id) proto.set_newest_frame_id(*opening.newest_frame_id);
  return proto;
}

StreamOpening FromProto(v1::StreamOpened proto) {
  StreamOpening opening;
  opening.resume_token = std::move(*proto.mutable_resume_token());
  opening.durable = proto.durable();
  for (const uint64_t id : proto.object_ids()) opening.objects.push_back(ObjectId{id});
  if (proto.has_newest_frame_id()) opening.newest_frame_id = proto.newest_frame_id();
  return opening;
}

std::vector<v1::ExportMapResponse> ToProto(MapSnapshot snapshot) {
  std::vector<v1::ExportMapResponse> parts(1);
  v1::ExportHeader& header = *parts.front().mutable_header();
  header.set_session_id(snapshot.session_id);
  header.set_state(EnumToProto(kSessionStates, snapshot.state));
  *header.mutable_statistics() = ToProto(snapshot.statistics);
  for (ObjectSnapshot& object : snapshot.objects) {
    v1::ObjectSnapshot& proto = *parts.emplace_back().mutable_object();
    *proto.mutable_object() = ToProto(std::move(object.object));
    if (object.mesh) *proto.mutable_mesh() = ToProto(std::move(*object.mesh));
  }
  // If the two arrays differ in length, the longer one is truncated.
  const size_t points = std::min(snapshot.trajectory.size(), snapshot.timestamps_ns.size());
  for (size_t i = 0; i < points; ++i) {
    if (i % kTrajectoryPointsPerPart == 0) parts.emplace_back().mutable_trajectory();
    v1::TrajectoryPoint& point = *parts.back().mutable_trajectory()->add_points();
    *point.mutable_frame() = ToProto(std::move(snapshot.trajectory[i]));
    point.set_timestamp_ns(snapshot.timestamps_ns[i]);
  }
  return parts;
}

absl::Status SnapshotAssembler::Add(v1::ExportMapResponse part) {
  if (part.has_header() == has_header_)
    return InvalidArgument("export: must have exactly one header, as its first part");
  switch (part.part_case()) {
    case v1::ExportMapResponse::kHeader: {
      const v1::ExportHeader& header = part.header();
      has_header_ = true;
      snapshot_.session_id = header.session_id();
      ROMAP_ASSIGN_OR_RETURN(snapshot_.state, EnumFromProto(kSessionStates, header.state(), "export.header.state"));
      ROMAP_ASSIGN_OR_RETURN(snapshot_.statistics, FromProto(header.statistics(), "export.header.statistics"));
      break;
    }
    case v1::ExportMapResponse::kObject: {
      const std::string where = fmt::format("export.objects[{}]", snapshot_.objects.size());
      ROMAP_ASSIGN_OR_RETURN(auto object, FromProto(std::move(*part.mutable_object()), where));
      snapshot_.objects.push_back(std::move(object));
      break;
    }
    case v1::ExportMapResponse::kTrajectory:
      for (v1::TrajectoryPoint& point : *part.mutable_trajectory()->mutable_points()) {
        const std::string where = fmt::format("export.trajectory[{}]", snapshot_.trajectory.size());
        if (!point.has_frame()) return InvalidArgument("{}.frame: missing", where);
        ROMAP_ASSIGN_OR_RETURN(auto ack, FromProto(std::move(*point.mutable_frame()), where + ".frame"));
        snapshot_.trajectory.push_back(std::move(ack));
        snapshot_.timestamps_ns.push_back(point.timestamp_ns());
      }
      break;
    default:
      break;
  }
  return absl::OkStatus();
}

absl::StatusOr<MapSnapshot> SnapshotAssembler::Take() {
  if (!has_header_) return InvalidArgument("export: header missing");
  return std::move(snapshot_);
}

}  // namespace romap::wire
