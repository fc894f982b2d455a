// What a client reads from a server that it need not trust: events, sessions and exports.

#include "common/wire/events.h"
#include "common/wire/sessions.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/parts.h"
#include "tests/fuzz/quiet_protobuf.h"
#include "tests/support/streams.h"

namespace romap::fuzz::wire_events_fuzz {
namespace {

void ReadEvent(const std::string& bytes) {
  v1::MapEvent proto;
  if (!proto.ParseFromString(bytes)) return;
  auto event = wire::FromProto(std::move(proto), "event");
  if (!event.ok()) return;
  const auto again = wire::FromProto(wire::ToProto(*std::move(event)), "event");
  Require(again.ok(), "an accepted event can be sent on");
}

void ReadInfo(const std::string& bytes) {
  v1::SessionInfo proto;
  if (!proto.ParseFromString(bytes)) return;
  const auto info = wire::FromProto(proto, "session");
  if (!info.ok()) return;
  Require(wire::FromProto(wire::ToProto(*info), "session").ok(), "an accepted session can be sent on");
}

void ReadExport(std::string_view bytes) {
  wire::SnapshotAssembler assembler;
  for (const std::string& part : SplitParts(bytes)) {
    v1::ExportMapResponse response;
    if (!response.ParseFromString(part) || !assembler.Add(std::move(response)).ok()) return;
  }
  auto snapshot = assembler.Take();
  if (!snapshot.ok()) return;
  Require(snapshot->trajectory.size() == snapshot->timestamps_ns.size(), "every pose has a time");
  (void)wire::ToProto(*std::move(snapshot));
}

MeshUpdate FullMesh() {
  MeshUpdate mesh;
  mesh.id = ObjectId{4};
  mesh.revision = 8;
  mesh.draco = "draco";
  mesh.texture = {.image = "jpeg", .media_type = "image/jpeg"};
  mesh.levels = {{.draco = "level", .triangle_count = 10, .error_mu = 0.1}};
  mesh.next_view = NextView{.direction = Eigen::Vector3d::UnitX(), .gain = 0.3};
  return mesh;
}

}  // namespace
}  // namespace romap::fuzz::wire_events_fuzz

std::vector<std::string> romap::fuzz::Seeds() {
  FrameAck ack;
  ack.frame_id = 7;
  ack.T_world_camera.emplace();
  ack.uncertainty = PoseUncertainty{};
  FrameAck rotated;
  rotated.frame_id = 8;
  rotated.R_world_camera = Eigen::Quaterniond::Identity();
  ObjectUpdate object;
  object.id = ObjectId{4};
  object.class_name = "mug";
  object.cuboid.half_extents = Eigen::Vector3d(1, 2, 3);
  object.T_world_mesh.emplace();
  Statistics statistics;
  statistics.frames_received = 9;
  statistics.diagnostics = {{.code = "layout", .severity = Severity::kInfo, .text = "read"}};
  const std::vector<MapEvent> events = {ack,
                                        rotated,
                                        object,
                                        wire_events_fuzz::FullMesh(),
                                        ObjectRemoved{.id = ObjectId{4}, .revision = 9, .reason = "false"},
                                        ObjectMerged{.from = ObjectId{4}, .into = ObjectId{5}, .revision = 3},
                                        statistics,
                                        MasksAck{.frame_id = 3},
                                        Durable{.frame_id = 4, .masks_frame_id = 2}};
  std::vector<std::string> seeds;
  for (const MapEvent& event : events) seeds.push_back("e" + wire::ToProto(event).SerializeAsString());
  SessionInfo info{.id = "a", .name = "kitchen", .camera = testing_support::SmallCamera(), .statistics = statistics};
  seeds.push_back("i" + wire::ToProto(info).SerializeAsString());
  MapSnapshot snapshot{.session_id = "a",
                       .objects = {{.object = object, .mesh = wire_events_fuzz::FullMesh()}},
                       .trajectory = {ack},
                       .timestamps_ns = {5},
                       .statistics = statistics};
  std::vector<std::string> parts;
  for (const auto& part : wire::ToProto(snapshot)) parts.push_back(part.SerializeAsString());
  seeds.push_back("x" + JoinParts(parts));
  return seeds;
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::string rest = romap::fuzz::TextOf(data + 1, size - 1);
  if (data[0] == 'e') romap::fuzz::wire_events_fuzz::ReadEvent(rest);
  if (data[0] == 'i') romap::fuzz::wire_events_fuzz::ReadInfo(rest);
  if (data[0] == 'x') romap::fuzz::wire_events_fuzz::ReadExport(rest);
  return 0;
}
