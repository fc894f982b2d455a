#include "common/wire/events.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "common/status.h"

namespace romap::wire::events_test {

using ::testing::HasSubstr;

template <class T>
T RoundTrip(const T& event) {
  const auto got = FromProto(ToProto(MapEvent(event)), "event");
  EXPECT_TRUE(got.ok()) << Message(got.status());
  return got.ok() && std::holds_alternative<T>(*got) ? std::get<T>(*got) : T{};
}

ObjectUpdate FullObject() {
  ObjectUpdate object;
  object.id = ObjectId{12};
  object.revision = 1ull << 60;
  object.state = ObjectState::kConfirmed;
  object.class_name = "teapot";
  object.class_score = 0.75;
  object.cuboid.T_world_object = {Eigen::Quaterniond(0.6, 0, 0, 0.8), Eigen::Vector3d(-1, 0, 4)};
  object.cuboid.half_extents = {0.1, 0.2, 0.3};
  object.cuboid.confidence = 0.5;
  object.observations = 99;
  object.T_world_mesh.emplace(Eigen::Quaterniond::Identity(), Eigen::Vector3d(7, 8, 9));
  object.mesh_scale = 1.25;
  object.map_id = SparseMapId{5};
  return object;
}

TEST(WireEvents, FrameAckRoundTrips) {
  FrameAck ack;
  ack.frame_id = 3;
  ack.accepted = false;
  ack.error = "too dark";
  ack.state = TrackingState::kRelocalized;
  ack.T_world_camera.emplace(Eigen::Quaterniond::Identity(), Eigen::Vector3d(1, 2, 3));
  ack.is_keyframe = true;
  ack.latency_s = 0.125;
  ack.map_id = SparseMapId{4};
  const FrameAck got = RoundTrip(ack);
  EXPECT_EQ(got.frame_id, ack.frame_id);
  EXPECT_EQ(got.accepted, ack.accepted);
  EXPECT_EQ(got.error, ack.error);
  EXPECT_EQ(got.state, ack.state);
  ASSERT_TRUE(got.T_world_camera.has_value());
  EXPECT_EQ(got.T_world_camera->translation(), ack.T_world_camera->translation());
  EXPECT_EQ(got.is_keyframe, ack.is_keyframe);
  EXPECT_EQ(got.latency_s, ack.latency_s);
  EXPECT_EQ(got.map_id, ack.map_id);
  EXPECT_FALSE(got.uncertainty.has_value());
}

TEST(WireEvents, UncertaintyOfAFrameRoundTrips) {
  FrameAck ack;
  ack.uncertainty = PoseUncertainty{.position_sigma_mu = 0.25, .rotation_sigma_rad = 0.0625};
  EXPECT_EQ(RoundTrip(ack).uncertainty, ack.uncertainty);
}

TEST(WireEvents, RotationOfAFrameRoundTrips) {
  FrameAck ack;
  EXPECT_FALSE(RoundTrip(ack).R_world_camera.has_value());
  ack.R_world_camera = Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5);
  ASSERT_TRUE(RoundTrip(ack).R_world_camera.has_value());
  EXPECT_EQ(RoundTrip(ack).R_world_camera->coeffs(), ack.R_world_camera->coeffs());
}

TEST(WireEvents, UncertaintyMustBePositive) {
  for (const double sigma : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    FrameAck ack;
    ack.uncertainty = PoseUncertainty{.position_sigma_mu = 0.25, .rotation_sigma_rad = sigma};
    const auto got = FromProto(ToProto(ack), "ack");
    EXPECT_THAT(std::string(got.status().message()), HasSubstr("ack.uncertainty")) << sigma;
  }
}

TEST(WireEvents, DurableRoundTrips) {
  const Durable got = RoundTrip(Durable{.frame_id = 7, .masks_frame_id = 5});
  EXPECT_EQ(got.frame_id, 7u);
  EXPECT_EQ(got.masks_frame_id, 5u);
}

TEST(WireEvents, MasksAckRoundTrips) {
  const MasksAck got = RoundTrip(MasksAck{.frame_id = 3, .accepted = false, .error = "too late"});
  EXPECT_EQ(got.frame_id, 3u);
  EXPECT_FALSE(got.accepted);
  EXPECT_EQ(got.error, "too late");
}

TEST(WireEvents, ObjectUpdateRoundTrips) {
  const ObjectUpdate object = FullObject();
  const ObjectUpdate got = RoundTrip(object);
  EXPECT_EQ(got.id, object.id);
  EXPECT_EQ(got.revision, object.revision);
  EXPECT_EQ(got.state, object.state);
  EXPECT_EQ(got.class_name, object.class_name);
  EXPECT_EQ(got.class_score, object.class_score);
  EXPECT_TRUE(got.cuboid.T_world_object.Matrix().isApprox(object.cuboid.T_world_object.Matrix(), 1e-15));
  EXPECT_EQ(got.cuboid.half_extents, object.cuboid.half_extents);
  EXPECT_EQ(got.cuboid.confidence, object.cuboid.confidence);
  EXPECT_EQ(got.observations, object.observations);
  ASSERT_TRUE(got.T_world_mesh.has_value());
  EXPECT_EQ(got.T_world_mesh->translation(), object.T_world_mesh->translation());
  EXPECT_EQ(got.mesh_scale, object.mesh_scale);
  EXPECT_EQ(got.map_id, object.map_id);
}

TEST(WireEvents, AbsentMeshScaleMeansOne) {
  v1::MapEvent proto = ToProto(MapEvent(FullObject()));
  proto.mutable_object()->clear_mesh_scale();
  const auto got = FromProto(proto, "event");
  ASSERT_TRUE(got.ok()) << Message(got.status());
  EXPECT_EQ(std::get<ObjectUpdate>(*got).mesh_scale, 1);
  proto.mutable_object()->set_mesh_scale(-0.5);
  EXPECT_THAT(Message(FromProto(proto, "event").status()), HasSubstr("event.object.mesh_scale: must not be negative"));
}

TEST(WireEvents, MeshUpdateRoundTrips) {
  MeshUpdate mesh;
  mesh.id = ObjectId{5};
  mesh.revision = 6;
  mesh.steps = 7;
  mesh.train_seconds = 8.5;
  mesh.final = true;
  mesh.vertex_count = 9;
  mesh.triangle_count = 10;
  mesh.draco = std::string("DRACO\0\xff", 7);
  mesh.texture = {std::string("PNG\0\xff", 5), "image/png"};
  mesh.levels = {{.draco = "level 1", .triangle_count = 3, .error_mu = 0.5}, {.draco = "level 2"}};
  mesh.next_view = {.direction = {0.6, 0, 0.8}, .gain = 0.25};
  const MeshUpdate got = RoundTrip(mesh);
  EXPECT_EQ(got.id, mesh.id);
  EXPECT_EQ(got.revision, mesh.revision);
  EXPECT_EQ(got.steps, mesh.steps);
  EXPECT_EQ(got.train_seconds, mesh.train_seconds);
  EXPECT_EQ(got.final, mesh.final);
  EXPECT_EQ(got.vertex_count, mesh.vertex_count);
  EXPECT_EQ(got.triangle_count, mesh.triangle_count);
  EXPECT_EQ(got.draco, mesh.draco);
  EXPECT_EQ(got.texture.image, mesh.texture.image);
  EXPECT_EQ(got.texture.media_type, mesh.texture.media_type);
  ASSERT_EQ(got.levels.size(), 2u);
  EXPECT_EQ(got.levels[0].draco, "level 1");
  EXPECT_EQ(got.levels[0].triangle_count, 3u);
  EXPECT_EQ(got.levels[0].error_mu, 0.5);
  EXPECT_EQ(got.levels[1].draco, "level 2");
  ASSERT_TRUE(got.next_view.has_value());
  EXPECT_EQ(got.next_view->direction, mesh.next_view->direction);
  EXPECT_EQ(got.next_view->gain, 0.25);
}

TEST(WireEvents, ATextureMustBeAPngOrJpegFile) {
  v1::MeshUpdate proto;
  proto.set_id(1);
  proto.set_texture("<svg>");
  proto.set_texture_media_type("image/svg+xml");
  EXPECT_THAT(Message(FromProto(proto, "mesh").status()),
              HasSubstr("mesh.texture_media_type: must be image/png or image/jpeg, got 'image/svg+xml'"));
}

TEST(WireEvents, RemovalAndMergeRoundTrip) {
  const auto removed = RoundTrip(ObjectRemoved{.id = ObjectId{1}, .revision = 2, .reason = "not observed again"});
  EXPECT_EQ(removed.id, ObjectId{1});
  EXPECT_EQ(removed.revision, 2u);
  EXPECT_EQ(removed.reason, "not observed again");
  const auto merged = RoundTrip(ObjectMerged{.from = ObjectId{3}, .into = ObjectId{4}, .revision = 5});
  EXPECT_EQ(merged.from, ObjectId{3});
  EXPECT_EQ(merged.into, ObjectId{4});
  EXPECT_EQ(merged.revision, 5u);
}

TEST(WireEvents, StatisticsRoundTrip) {
  const Statistics statistics{.frames_received = 1,
                              .frames_processed = 2,
                              .frames_dropped = 3,
                              .frames_rejected = 4,
                              .keyframes = 5,
                              .map_points = 6,
                              .objects = 7,
                              .objects_training = 8,
                              .training_steps = 9,
                              .training_progress = 0.5,
                              .resident_bytes = 1ull << 40,
                              .diagnostics = {{.code = "up_unknown",
                                               .severity = Severity::kError,
                                               .first_frame_id = 7,
                                               .count = 3,
                                               .text = "no evidence",
                                               .advice = "send gravity"}}};
  const Statistics got = RoundTrip(statistics);
  EXPECT_EQ(got.frames_received, 1u);
  EXPECT_EQ(got.frames_processed, 2u);
  EXPECT_EQ(got.frames_dropped, 3u);
  EXPECT_EQ(got.frames_rejected, 4u);
  EXPECT_EQ(got.keyframes, 5u);
  EXPECT_EQ(got.map_points, 6u);
  EXPECT_EQ(got.objects, 7u);
  EXPECT_EQ(got.objects_training, 8u);
  EXPECT_EQ(got.training_steps, 9u);
  EXPECT_EQ(got.training_progress, 0.5);
  EXPECT_EQ(got.resident_bytes, 1ull << 40);
  ASSERT_EQ(got.diagnostics.size(), 1u);
  EXPECT_EQ(got.diagnostics[0].code, "up_unknown");
  EXPECT_EQ(got.diagnostics[0].severity, Severity::kError);
  EXPECT_EQ(got.diagnostics[0].first_frame_id, 7u);
  EXPECT_EQ(got.diagnostics[0].count, 3u);
  EXPECT_EQ(got.diagnostics[0].text, "no evidence");
  EXPECT_EQ(got.diagnostics[0].advice, "send gravity");
}

void ExpectError(const v1::MapEvent& proto, const char* message) {
  const auto got = FromProto(proto, "event");
  EXPECT_EQ(got.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(Message(got.status()), HasSubstr(message));
}

TEST(WireEvents, ErrorsNameTheField) {
  ExpectError({}, "event: unknown kind of event");

  v1::MapEvent proto = ToProto(MapEvent(FullObject()));
  proto.mutable_object()->set_id(0);
  ExpectError(proto, "event.object.id: missing");

  proto = ToProto(MapEvent(FullObject()));
  proto.mutable_object()->clear_cuboid();
  ExpectError(proto, "event.object.cuboid: missing");

  proto = ToProto(MapEvent(FullObject()));
  proto.mutable_object()->mutable_cuboid()->mutable_half_extents()->set_y(-0.1);
  ExpectError(proto, "event.object.cuboid.half_extents");

  proto = ToProto(MapEvent(FullObject()));
  proto.mutable_object()->mutable_t_world_mesh()->mutable_rotation()->set_w(2);
  ExpectError(proto, "event.object.t_world_mesh.rotation");

  proto = ToProto(MapEvent(FullObject()));
  proto.mutable_object()->set_state(v1::OBJECT_STATE_UNSPECIFIED);
  ExpectError(proto, "event.object.state: must be one of OBJECT_STATE_PROVISIONAL");

  proto = ToProto(MapEvent(FrameAck{}));
  proto.mutable_frame_ack()->set_latency_s(std::numeric_limits<double>::quiet_NaN());
  ExpectError(proto, "event.frame_ack.latency_s");
}

}  // namespace romap::wire::events_test
