#include "server/store/blob_content.h"

#include <utility>
#include <variant>

#include "common/status.h"
#include "common/wire/events.h"
#include "common/wire/frame.h"
#include "romap/v1/mapping.pb.h"

namespace romap::store {
namespace {

absl::Status Damaged(const std::string& what, const std::string& why) {
  return absl::DataLossError(fmt::format("the stored {} is damaged: {}", what, why));
}

}  // namespace

std::string InputContent(const SessionInput& input) {
  v1::MapRequest request;
  if (const auto* masks = std::get_if<MasksInput>(&input)) {
    *request.mutable_late_masks() = wire::ToProto(*masks);
    request.mutable_late_masks()->clear_resent();
  } else {
    *request.mutable_frame() = wire::ToProto(std::get<FrameInput>(input));
    request.mutable_frame()->clear_resent();
  }
  return request.SerializeAsString();
}

absl::StatusOr<SessionInput> ParseInput(const std::string& content) {
  v1::MapRequest request;
  if (!request.ParseFromString(content)) return Damaged("input", "cannot be parsed");
  if (request.has_late_masks()) {
    auto masks = wire::FromProto(std::move(*request.mutable_late_masks()));
    if (!masks.ok()) return Damaged("input", Message(masks.status()));
    return SessionInput(*std::move(masks));
  }
  auto frame = wire::FromProto(std::move(*request.mutable_frame()));
  if (!frame.ok()) return Damaged("input", Message(frame.status()));
  return SessionInput(*std::move(frame));
}

std::string ObjectContent(const ObjectUpdate& object) { return wire::ToProto(object).SerializeAsString(); }

absl::StatusOr<ObjectUpdate> ParseObject(const std::string& content) {
  v1::ObjectUpdate proto;
  if (!proto.ParseFromString(content)) return Damaged("object", "cannot be parsed");
  auto object = wire::FromProto(std::move(proto), "object");
  if (!object.ok()) return Damaged("object", Message(object.status()));
  return object;
}

std::string MeshContent(const MeshUpdate& mesh) { return wire::ToProto(mesh).SerializeAsString(); }

absl::StatusOr<MeshUpdate> ParseMesh(const std::string& content) {
  v1::MeshUpdate proto;
  if (!proto.ParseFromString(content)) return Damaged("mesh", "cannot be parsed");
  auto mesh = wire::FromProto(std::move(proto), "mesh");
  if (!mesh.ok()) return Damaged("mesh", Message(mesh.status()));
  return mesh;
}

std::string TrajectoryContent(const std::vector<FrameAck>& frames, const std::vector<int64_t>& timestamps_ns) {
  v1::TrajectoryPiece piece;
  for (size_t i = 0; i < frames.size(); ++i) {
    v1::TrajectoryPoint& point = *piece.add_points();
    *point.mutable_frame() = wire::ToProto(frames[i]);
    point.set_timestamp_ns(timestamps_ns[i]);
  }
  return piece.SerializeAsString();
}

absl::Status ParseTrajectory(const std::string& content, std::vector<FrameAck>* frames,
                             std::vector<int64_t>* timestamps_ns) {
  v1::TrajectoryPiece piece;
  if (!piece.ParseFromString(content)) return Damaged("trajectory", "cannot be parsed");
  for (v1::TrajectoryPoint& point : *piece.mutable_points()) {
    auto frame = wire::FromProto(std::move(*point.mutable_frame()), "frame");
    if (!frame.ok()) return Damaged("trajectory", Message(frame.status()));
    frames->push_back(*std::move(frame));
    timestamps_ns->push_back(point.timestamp_ns());
  }
  return absl::OkStatus();
}

}  // namespace romap::store
