#include "common/wire/events.h"

#include <utility>
#include <variant>

#include "common/status.h"
#include "common/wire/enums.h"
#include "common/wire/geometry.h"

namespace romap::wire {
namespace {

// Without these, the overloads below would hide the public ones.
using wire::FromProto;
using wire::ToProto;

absl::StatusOr<ObjectId> ObjectIdFromProto(uint64_t value, const std::string& where) {
  if (value == 0) return InvalidArgument("{}: missing; ids start at 1", where);
  return ObjectId{value};
}

v1::Cuboid ToProto(const Cuboid& cuboid) {
  v1::Cuboid proto;
  *proto.mutable_t_world_object() = ToProto(cuboid.T_world_object);
  *proto.mutable_half_extents() = ToProto(cuboid.half_extents);
  proto.set_confidence(cuboid.confidence);
  return proto;
}

absl::StatusOr<Cuboid> FromProto(const v1::Cuboid& proto, const std::string& where) {
  if (!proto.has_t_world_object()) return InvalidArgument("{}.t_world_object: missing", where);
  if (!proto.has_half_extents()) return InvalidArgument("{}.half_extents: missing", where);
  Cuboid cuboid;
  ROMAP_ASSIGN_OR_RETURN(cuboid.T_world_object,
                         (TransformFromProto<World, Object>(proto.t_world_object(), where + ".t_world_object")));
  ROMAP_ASSIGN_OR_RETURN(cuboid.half_extents, VectorFromProto(proto.half_extents(), where + ".half_extents"));
  if (cuboid.half_extents.minCoeff() < 0) return InvalidArgument("{}.half_extents: must not be negative", where);
  ROMAP_RETURN_IF_ERROR(CheckFinite(proto.confidence(), where + ".confidence"));
  cuboid.confidence = proto.confidence();
  return cuboid;
}

absl::StatusOr<PoseUncertainty> FromProto(const v1::PoseUncertainty& proto, const std::string& where) {
  ROMAP_RETURN_IF_ERROR(CheckFinite(proto.position_sigma(), where + ".position_sigma"));
  ROMAP_RETURN_IF_ERROR(CheckFinite(proto.rotation_sigma_rad(), where + ".rotation_sigma_rad"));
  if (!(proto.position_sigma() > 0 && proto.rotation_sigma_rad() > 0)) {
    return InvalidArgument("{}: the standard deviations must be positive", where);
  }
  return PoseUncertainty{proto.position_sigma(), proto.rotation_sigma_rad()};
}

v1::ObjectRemoved ToProto(ObjectRemoved removed) {
  v1::ObjectRemoved proto;
  proto.set_id(removed.id.value);
  proto.set_revision(removed.revision);
  proto.set_reason(std::move(removed.reason));
  return proto;
}

absl::StatusOr<ObjectRemoved> FromProto(v1::ObjectRemoved proto, const std::string& where) {
  ObjectRemoved removed;
  ROMAP_ASSIGN_OR_RETURN(removed.id, ObjectIdFromProto(proto.id(), where + ".id"));
  removed.revision = proto.revision();
  removed.reason = std::move(*proto.mutable_reason());
  return removed;
}

v1::ObjectMerged ToProto(const ObjectMerged& merged) {
  v1::ObjectMerged proto;
  proto.set_from(merged.from.value);
  proto.set_into(merged.into.value);
  proto.set_revision(merged.revision);
  return proto;
}

absl::StatusOr<ObjectMerged> FromProto(const v1::ObjectMerged& proto, const std::string& where) {
  ObjectMerged merged;
  ROMAP_ASSIGN_OR_RETURN(merged.from, ObjectIdFromProto(proto.from(), where + ".from"));
  ROMAP_ASSIGN_OR_RETURN(merged.into, ObjectIdFromProto(proto.into(), where + ".into"));
  merged.revision = proto.revision();
  return merged;
}

v1::MasksAck ToProto(MasksAck ack) {
  v1::MasksAck proto;
  proto.set_frame_id(ack.frame_id);
  proto.set_accepted(ack.accepted);
  proto.set_error(std::move(ack.error));
  proto.set_duplicate(ack.duplicate);
  return proto;
}

MasksAck FromProto(v1::MasksAck proto) {
  return {.frame_id = proto.frame_id(),
          .accepted = proto.accepted(),
          .error = std::move(*proto.mutable_error()),
          .duplicate = proto.duplicate()};
}

v1::Durable ToProto(const Durable& durable) {
  v1::Durable proto;
  proto.set_frame_id(durable.frame_id);
  proto.set_masks_frame_id(durable.masks_frame_id);
  return proto;
}

v1::Diagnostic ToProto(const Diagnostic& diagnostic) {
  v1::Diagnostic proto;
  proto.set_code(diagnostic.code);
  proto.set_text(diagnostic.text);
  proto.set_severity(EnumToProto(kSeverities, diagnostic.severity));
  proto.set_first_frame_id(diagnostic.first_frame_id);
  proto.set_count(diagnostic.count);
  proto.set_advice(diagnostic.advice);
  return proto;
}

// An unknown severity is read as a warning, the only one of older servers.
Diagnostic FromProto(const v1::Diagnostic& proto) {
  const auto severity = EnumFromProto(kSeverities, proto.severity(), "severity");
  return {.code = proto.code(),
          .severity = severity.ok() ? *severity : Severity::kWarning,
          .first_frame_id = proto.first_frame_id(),
          .count = proto.count(),
          .text = proto.text(),
          .advice = proto.advice()};
}

// Sets the member of the oneof for each kind of event.
struct EventWriter {
  v1::MapEvent& proto;
  void operator()(FrameAck&& ack) const { *proto.mutable_frame_ack() = ToProto(std::move(ack)); }
  void operator()(ObjectUpdate&& update) const { *proto.mutable_object() = ToProto(std::move(update)); }
  void operator()(MeshUpdate&& update) const { *proto.mutable_mesh() = ToProto(std::move(update)); }
  void operator()(ObjectRemoved&& removed) const { *proto.mutable_removed() = ToProto(std::move(removed)); }
  void operator()(ObjectMerged&& merged) const { *proto.mutable_merged() = ToProto(merged); }
  void operator()(Statistics&& statistics) const { *proto.mutable_statistics() = ToProto(statistics); }
  void operator()(MasksAck&& ack) const { *proto.mutable_masks_ack() = ToProto(std::move(ack)); }
  void operator()(Diagnostic&& diagnostic) const { *proto.mutable_diagnostic() = ToProto(diagnostic); }
  void operator()(Durable&& durable) const { *proto.mutable_durable() = ToProto(durable); }
};

}  // namespace

v1::MapEvent ToProto(MapEvent event) {
  v1::MapEvent proto;
  std::visit(EventWriter{proto}, std::move(event));
  return proto;
}

absl::StatusOr<MapEvent> FromProto(v1::MapEvent proto, const std::string& where) {
  switch (proto.event_case()) {
    case v1::MapEvent::kFrameAck:
      return FromProto(std::move(*proto.mutable_frame_ack()), where + ".frame_ack");
    case v1::MapEvent::kObject:
      return FromProto(std::move(*proto.mutable_object()), where + ".object");
    case v1::MapEvent::kMesh:
      return FromProto(std::move(*proto.mutable_mesh()), where + ".mesh");
    case v1::MapEvent::kRemoved:
      return FromProto(std::move(*proto.mutable_removed()), where + ".removed");
    case v1::MapEvent::kMerged:
      return FromProto(proto.merged(), where + ".merged");
    case v1::MapEvent::kStatistics:
      return FromProto(proto.statistics(), where + ".statistics");
    case v1::MapEvent::kMasksAck:
      return FromProto(std::move(*proto.mutable_masks_ack()));
    case v1::MapEvent::kDiagnostic:
      return FromProto(proto.diagnostic());
    case v1::MapEvent::kDurable:
      return Durable{.frame_id = proto.durable().frame_id(), .masks_frame_id = proto.durable().masks_frame_id()};
    default:
      return InvalidArgument("{}: unknown kind of event", where);
  }
}

v1::FrameAck ToProto(FrameAck ack) {
  v1::FrameAck proto;
  proto.set_frame_id(ack.frame_id);
  proto.set_accepted(ack.accepted);
  proto.set_error(std::move(ack.error));
  proto.set_state(EnumToProto(kTrackingStates, ack.state));
  if (ack.T_world_camera) *proto.mutable_t_world_camera() = ToProto(*ack.T_world_camera);
  proto.set_is_keyframe(ack.is_keyframe);
  proto.set_latency_s(ack.latency_s);
  proto.set_state_reason(std::move(ack.state_reason));
  if (ack.uncertainty) {
    proto.mutable_uncertainty()->set_position_sigma(ack.uncertainty->position_sigma_mu);
    proto.mutable_uncertainty()->set_rotation_sigma_rad(ack.uncertainty->rotation_sigma_rad);
  }
  proto.set_map_id(ack.map_id.value);
  if (ack.R_world_camera) *proto.mutable_rotation_world_camera() = ToProto(*ack.R_world_camera);
  proto.set_duplicate(ack.duplicate);
  return proto;
}

absl::StatusOr<FrameAck> FromProto(v1::FrameAck proto, const std::string& where) {
  FrameAck ack;
  ack.frame_id = proto.frame_id();
  ack.accepted = proto.accepted();
  ack.error = std::move(*proto.mutable_error());
  ROMAP_ASSIGN_OR_RETURN(ack.state, EnumFromProto(kTrackingStates, proto.state(), where + ".state"));
  if (proto.has_t_world_camera()) {
    ROMAP_ASSIGN_OR_RETURN(ack.T_world_camera,
                           (TransformFromProto<World, Camera>(proto.t_world_camera(), where + ".t_world_camera")));
  }
  ack.is_keyframe = proto.is_keyframe();
  ROMAP_RETURN_IF_ERROR(CheckFinite(proto.latency_s(), where + ".latency_s"));
  ack.latency_s = proto.latency_s();
  ack.state_reason = std::move(*proto.mutable_state_reason());
  if (proto.has_uncertainty()) {
    ROMAP_ASSIGN_OR_RETURN(ack.uncertainty, FromProto(proto.uncertainty(), where + ".uncertainty"));
  }
  ack.map_id = SparseMapId{proto.map_id()};
  ack.duplicate = proto.duplicate();
  if (proto.has_rotation_world_camera()) {
    ROMAP_ASSIGN_OR_RETURN(ack.R_world_camera,
                           QuaternionFromProto(proto.rotation_world_camera(), where + ".rotation_world_camera"));
  }
  return ack;
}

v1::ObjectUpdate ToProto(ObjectUpdate update) {
  v1::ObjectUpdate proto;
  proto.set_id(update.id.value);
  proto.set_revision(update.revision);
  proto.set_state(EnumToProto(kObjectStates, update.state));
  proto.set_class_name(std::move(update.class_name));
  proto.set_class_score(update.class_score);
  *proto.mutable_cuboid() = ToProto(update.cuboid);
  proto.set_observations(update.observations);
  if (update.T_world_mesh) *proto.mutable_t_world_mesh() = ToProto(*update.T_world_mesh);
  proto.set_mesh_scale(update.mesh_scale);
  proto.set_map_id(update.map_id.value);
  return proto;
}

absl::StatusOr<ObjectUpdate> FromProto(v1::ObjectUpdate proto, const std::string& where) {
  ObjectUpdate update;
  ROMAP_ASSIGN_OR_RETURN(update.id, ObjectIdFromProto(proto.id(), where + ".id"));
  update.revision = proto.revision();
  ROMAP_ASSIGN_OR_RETURN(update.state, EnumFromProto(kObjectStates, proto.state(), where + ".state"));
  update.class_name = std::move(*proto.mutable_class_name());
  ROMAP_RETURN_IF_ERROR(CheckFinite(proto.class_score(), where + ".class_score"));
  update.class_score = proto.class_score();
  if (!proto.has_cuboid()) return InvalidArgument("{}.cuboid: missing", where);
  ROMAP_ASSIGN_OR_RETURN(update.cuboid, FromProto(proto.cuboid(), where + ".cuboid"));
  update.observations = proto.observations();
  if (proto.has_t_world_mesh()) {
    ROMAP_ASSIGN_OR_RETURN(update.T_world_mesh,
                           (TransformFromProto<World, Object>(proto.t_world_mesh(), where + ".t_world_mesh")));
  }
  ROMAP_RETURN_IF_ERROR(CheckFinite(proto.mesh_scale(), where + ".mesh_scale"));
  if (proto.mesh_scale() < 0) return InvalidArgument("{}.mesh_scale: must not be negative", where);
  if (proto.mesh_scale() > 0) update.mesh_scale = proto.mesh_scale();
  update.map_id = SparseMapId{proto.map_id()};
  return update;
}

v1::MeshUpdate ToProto(MeshUpdate update) {
  v1::MeshUpdate proto;
  proto.set_id(update.id.value);
  proto.set_revision(update.revision);
  proto.set_steps(update.steps);
  proto.set_train_seconds(update.train_seconds);
  proto.set_is_final(update.final);
  proto.set_vertex_count(update.vertex_count);
  proto.set_triangle_count(update.triangle_count);
  proto.set_draco(std::move(update.draco));
  proto.set_texture(std::move(update.texture.image));
  proto.set_texture_media_type(update.texture.media_type);
  for (MeshLevel& level : update.levels) {
    v1::MeshLevel& added = *proto.add_levels();
    added.set_draco(std::move(level.draco));
    added.set_triangle_count(level.triangle_count);
    added.set_error_mu(level.error_mu);
  }
  if (update.next_view) {
    *proto.mutable_next_view()->mutable_direction() = ToProto(update.next_view->direction);
    proto.mutable_next_view()->set_gain(update.next_view->gain);
  }
  return proto;
}

absl::StatusOr<MeshUpdate> FromProto(v1::MeshUpdate proto, const std::string& where) {
  MeshUpdate update;
  ROMAP_ASSIGN_OR_RETURN(update.id, ObjectIdFromProto(proto.id(), where + ".id"));
  update.revision = proto.revision();
  update.steps = proto.steps();
  ROMAP_RETURN_IF_ERROR(CheckFinite(proto.train_seconds(), where + ".train_seconds"));
  update.train_seconds = proto.train_seconds();
  update.final = proto.is_final();
  update.vertex_count = proto.vertex_count();
  update.triangle_count = proto.triangle_count();
  update.draco = std::move(*proto.mutable_draco());
  const std::string& media_type = proto.texture_media_type();
  if (!proto.texture().empty() && media_type != "image/png" && media_type != "image/jpeg") {
    return InvalidArgument("{}.texture_media_type: must be image/png or image/jpeg, got '{}'", where, media_type);
  }
  update.texture = {std::move(*proto.mutable_texture()), media_type};
  for (v1::MeshLevel& level : *proto.mutable_levels()) {
    ROMAP_RETURN_IF_ERROR(CheckFinite(level.error_mu(), where + ".levels.error_mu"));
    update.levels.push_back({std::move(*level.mutable_draco()), level.triangle_count(), level.error_mu()});
  }
  if (proto.has_next_view()) {
    NextView& next_view = update.next_view.emplace();
    ROMAP_ASSIGN_OR_RETURN(next_view.direction,
                           VectorFromProto(proto.next_view().direction(), where + ".next_view.direction"));
    ROMAP_RETURN_IF_ERROR(CheckFinite(proto.next_view().gain(), where + ".next_view.gain"));
    next_view.gain = proto.next_view().gain();
  }
  return update;
}

v1::Statistics ToProto(const Statistics& statistics) {
  v1::Statistics proto;
  proto.set_frames_received(statistics.frames_received);
  proto.set_frames_processed(statistics.frames_processed);
  proto.set_frames_dropped(statistics.frames_dropped);
  proto.set_frames_rejected(statistics.frames_rejected);
  proto.set_keyframes(statistics.keyframes);
  proto.set_map_points(statistics.map_points);
  proto.set_objects(statistics.objects);
  proto.set_objects_training(statistics.objects_training);
  proto.set_training_steps(statistics.training_steps);
  proto.set_training_progress(statistics.training_progress);
  proto.set_resident_bytes(statistics.resident_bytes);
  for (const Diagnostic& diagnostic : statistics.diagnostics) *proto.add_diagnostics() = ToProto(diagnostic);
  return proto;
}

absl::StatusOr<Statistics> FromProto(const v1::Statistics& proto, const std::string& where) {
  ROMAP_RETURN_IF_ERROR(CheckFinite(proto.training_progress(), where + ".training_progress"));
  std::vector<Diagnostic> diagnostics;
  for (const v1::Diagnostic& diagnostic : proto.diagnostics()) diagnostics.push_back(FromProto(diagnostic));
  return Statistics{.frames_received = proto.frames_received(),
                    .frames_processed = proto.frames_processed(),
                    .frames_dropped = proto.frames_dropped(),
                    .frames_rejected = proto.frames_rejected(),
                    .keyframes = proto.keyframes(),
                    .map_points = proto.map_points(),
                    .objects = proto.objects(),
                    .objects_training = proto.objects_training(),
                    .training_steps = proto.training_steps(),
                    .training_progress = proto.training_progress(),
                    .resident_bytes = proto.resident_bytes(),
                    .diagnostics = std::move(diagnostics)};
}

}  // namespace romap::wire
