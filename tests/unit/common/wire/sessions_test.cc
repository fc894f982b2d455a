#include "common/wire/sessions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/status.h"
#include "common/wire/status.h"

namespace romap::wire::sessions_test {

using ::testing::HasSubstr;
using ::testing::SizeIs;

CameraModel SomeCamera() {
  CameraModel camera;
  camera.width_px = 640;
  camera.height_px = 480;
  camera.fx_px = 500.5;
  camera.fy_px = 501.5;
  camera.cx_px = 320;
  camera.cy_px = 240;
  camera.distortion = {0.1, 0.2, 0.3, 0.4, 0.5};
  camera.readout_s = 0.02;
  return camera;
}

TEST(WireSessions, OptionsRoundTrip) {
  const auto got = FromProto(ToProto(SessionOptions{.name = "desk", .camera = SomeCamera(), .mode = FrameMode::kLive}));
  ASSERT_TRUE(got.ok()) << Message(got.status());
  EXPECT_EQ(got->name, "desk");
  EXPECT_EQ(got->camera, SomeCamera());
  EXPECT_EQ(got->mode, FrameMode::kLive);
}

TEST(WireSessions, UpRoundTripsAndMustNotBeZero) {
  v1::CreateSessionRequest proto = ToProto(SessionOptions{.name = "", .camera = SomeCamera()});
  EXPECT_FALSE(FromProto(proto)->up_world.has_value());
  proto = ToProto(SessionOptions{.name = "", .camera = SomeCamera(), .up_world = Eigen::Vector3d(0, -2, 0)});
  EXPECT_EQ(FromProto(proto)->up_world, Eigen::Vector3d(0, -2, 0));
  EXPECT_FALSE(FromProto(proto)->estimate_up);
  proto.mutable_up_world()->set_y(0);
  EXPECT_THAT(Message(FromProto(proto).status()), HasSubstr("up_world: is zero; expected a direction"));
  proto = ToProto(SessionOptions{.name = "", .camera = SomeCamera(), .estimate_up = true});
  EXPECT_TRUE(FromProto(proto)->estimate_up);
}

TEST(WireSessions, FisheyeCameraRoundTripsWithFourCoefficients) {
  CameraModel camera = SomeCamera();
  camera.lens = LensModel::kFisheye;
  camera.distortion = {0.1, 0.2, 0.3, 0.4, 0};
  v1::CreateSessionRequest proto = ToProto(SessionOptions{.name = "", .camera = camera});
  EXPECT_EQ(proto.camera().distortion_size(), 4);
  EXPECT_EQ(FromProto(proto)->camera, camera);
  proto.mutable_camera()->add_distortion(0.5);
  EXPECT_THAT(Message(FromProto(proto).status()), HasSubstr("must have no coefficients or 4 (k1 k2 k3 k4), has 5"));
}

TEST(WireSessions, AbsentLensMeansRadialTangential) {
  v1::CreateSessionRequest proto = ToProto(SessionOptions{.name = "", .camera = SomeCamera()});
  proto.mutable_camera()->clear_lens();
  EXPECT_EQ(FromProto(proto)->camera, SomeCamera());
}

TEST(WireSessions, AbsentModeMeansReplay) {
  v1::CreateSessionRequest proto = ToProto(SessionOptions{.name = "", .camera = SomeCamera()});
  proto.clear_mode();
  EXPECT_EQ(FromProto(proto)->mode, FrameMode::kReplay);
}

TEST(WireSessions, ErrorsNameTheField) {
  const v1::CreateSessionRequest good = ToProto(SessionOptions{.name = "", .camera = SomeCamera()});
  v1::CreateSessionRequest proto = good;
  proto.clear_camera();
  EXPECT_THAT(Message(FromProto(proto).status()), HasSubstr("camera: missing"));
  proto = good;
  proto.mutable_camera()->mutable_distortion()->RemoveLast();
  EXPECT_THAT(Message(FromProto(proto).status()),
              HasSubstr("camera.distortion: must have no coefficients or 5 (k1 k2 p1 p2 k3), has 4"));
  proto = good;
  proto.mutable_camera()->set_lens(static_cast<v1::LensModel>(9));
  EXPECT_THAT(Message(FromProto(proto).status()), HasSubstr("camera.lens: must be one of"));
  proto = good;
  proto.mutable_camera()->set_width_px(0xffffffff);
  EXPECT_THAT(Message(FromProto(proto).status()),
              HasSubstr("camera: size must be in 16..8192 px, is 4294967295x480 px"));
  proto = good;
  proto.set_mode(static_cast<v1::FrameMode>(17));
  EXPECT_THAT(Message(FromProto(proto).status()), HasSubstr("mode: must be one of"));
}

TEST(WireSessions, InfoRoundTrips) {
  SessionInfo info;
  info.id = "abc";
  info.name = "desk";
  info.camera = SomeCamera();
  info.mode = FrameMode::kLive;
  info.state = SessionState::kFinishing;
  info.created_unix_ns = 1'700'000'000'000'000'000;
  info.stream_open = true;
  info.statistics.keyframes = 3;
  const auto got = FromProto(ToProto(info), "session");
  ASSERT_TRUE(got.ok()) << Message(got.status());
  EXPECT_EQ(got->id, info.id);
  EXPECT_EQ(got->name, info.name);
  EXPECT_EQ(got->camera, info.camera);
  EXPECT_EQ(got->mode, info.mode);
  EXPECT_EQ(got->state, info.state);
  EXPECT_EQ(got->created_unix_ns, info.created_unix_ns);
  EXPECT_TRUE(got->stream_open);
  EXPECT_EQ(got->statistics.keyframes, 3u);
}

MapSnapshot BigSnapshot() {
  MapSnapshot snapshot;
  snapshot.session_id = "abc";
  snapshot.state = SessionState::kFinished;
  snapshot.statistics.map_points = 11;
  for (uint64_t id = 1; id <= 3; ++id) {
    ObjectSnapshot& object = snapshot.objects.emplace_back();
    object.object.id = ObjectId{id};
    if (id != 2) object.mesh = MeshUpdate{.id = ObjectId{id}, .draco = std::string(id, 'm')};
  }
  for (uint64_t id = 1; id <= 10'000; ++id) {
    snapshot.trajectory.emplace_back().frame_id = id;
    snapshot.timestamps_ns.push_back(static_cast<int64_t>(10 * id));
  }
  return snapshot;
}

TEST(WireSessions, ExportRoundTrips) {
  const std::vector<v1::ExportMapResponse> parts = ToProto(BigSnapshot());
  EXPECT_GT(parts.size(), 5u) << "a long trajectory must not be one message";
  SnapshotAssembler assembler;
  for (const auto& part : parts) {
    EXPECT_LT(part.ByteSizeLong(), 2u << 20);
    ASSERT_TRUE(assembler.Add(part).ok());
  }
  const auto got = assembler.Take();
  ASSERT_TRUE(got.ok());
  EXPECT_EQ(got->session_id, "abc");
  EXPECT_EQ(got->state, SessionState::kFinished);
  EXPECT_EQ(got->statistics.map_points, 11u);
  ASSERT_THAT(got->objects, SizeIs(3));
  EXPECT_EQ(got->objects[2].mesh->draco, "mmm");
  EXPECT_FALSE(got->objects[1].mesh.has_value());
  ASSERT_THAT(got->trajectory, SizeIs(10'000));
  ASSERT_THAT(got->timestamps_ns, SizeIs(10'000));
  EXPECT_EQ(got->trajectory.back().frame_id, 10'000u);
  EXPECT_EQ(got->timestamps_ns.back(), 100'000);
}

TEST(WireSessions, ExportOutOfOrderIsRejected) {
  const std::vector<v1::ExportMapResponse> parts = ToProto(BigSnapshot());
  EXPECT_FALSE(SnapshotAssembler().Add(parts[1]).ok()) << "object before header";
  EXPECT_FALSE(SnapshotAssembler().Take().ok()) << "no header at all";
  SnapshotAssembler twice;
  ASSERT_TRUE(twice.Add(parts[0]).ok());
  EXPECT_FALSE(twice.Add(parts[0]).ok()) << "two headers";
}

TEST(WireSessions, UnknownPartOfAnExportIsSkipped) {
  SnapshotAssembler assembler;
  ASSERT_TRUE(assembler.Add(ToProto(BigSnapshot())[0]).ok());
  EXPECT_TRUE(assembler.Add({}).ok());
  EXPECT_TRUE(assembler.Take().ok());
}

TEST(WireStatus, EveryCodeRoundTripsWithItsMessage) {
  for (int code = 0; code <= 16; ++code) {
    const absl::Status sent(static_cast<absl::StatusCode>(code), "field: error");
    EXPECT_EQ(FromGrpc(ToGrpc(sent)), sent);
  }
}

}  // namespace romap::wire::sessions_test
