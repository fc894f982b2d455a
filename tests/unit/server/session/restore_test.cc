// Sessions of a service with a store, after the service is started again.

#include <gmock/gmock.h>

#include <map>
#include <set>

#include "client/sdk/map_copy.h"
#include "common/status.h"
#include "server/session/local_mapping_service.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"
#include "tests/support/world_input.h"

namespace romap::session::restore_test {

using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

class RestoreTest : public ::testing::Test {
 protected:
  void StartService() {
    service_ = nullptr;  // the data folder has one user
    store::StoreConfig store;
    store.data_dir = folder_.path();
    ServerConfig config;
    config.nerf.first_budget_steps = config.nerf.full_budget_steps = 40;
    config.mesh.resolution = config.mesh.min_side_nodes = 24;
    config.mesh.texture = false;
    auto opened = store::Store::Open(store);
    ASSERT_TRUE(opened.ok()) << Message(opened.status());
    service_ = std::make_unique<LocalMappingService>(config, *std::move(opened));
  }
  std::string NewSession() {
    SessionOptions options;
    options.name = "table";
    options.camera = world_.camera();
    return service_->CreateSession(options)->id;
  }
  // As a client that waits while the session is restored.
  std::unique_ptr<MapStream> Open(const std::string& session) {
    std::unique_ptr<MapStream> stream;
    EXPECT_TRUE(testing_support::Eventually([&] {
      auto opened = service_->OpenMap(session);
      if (opened.ok()) stream = *std::move(opened);
      return opened.ok() || !absl::IsUnavailable(opened.status());
    }));
    return stream;
  }
  void Send(MapStream& stream, int first, int end) {
    for (int i = first; i < end; ++i) ASSERT_TRUE(stream.Send(testing_support::MakeWorldInput(world_, i)).ok());
  }
  static void WaitUntilDurable(MapStream& stream, uint64_t frame_id) {
    while (true) {
      const auto durable = testing_support::NextOf<Durable>(stream);
      ASSERT_TRUE(durable.has_value());
      if (durable->frame_id >= frame_id) return;
    }
  }
  MapSnapshot Export(const std::string& session) { return service_->ExportMap(session).value(); }
  static std::set<ObjectId> IdsOf(const MapSnapshot& map) {
    std::set<ObjectId> ids;
    for (const ObjectSnapshot& object : map.objects) ids.insert(object.object.id);
    return ids;
  }
  static SyntheticWorldOptions Options() {
    SyntheticWorldOptions options;
    options.width_px = 160;
    options.height_px = 120;
    options.focal_px = 150;
    return options;
  }

  testing_support::TemporaryFolder folder_;
  SyntheticWorld world_{Options()};
  std::unique_ptr<LocalMappingService> service_;
};

TEST_F(RestoreTest, AnOpenSessionIsServedFromTheStoreAndThenGoesOn) {
  StartService();
  const std::string session = NewSession();
  {
    const auto stream = Open(session);
    EXPECT_TRUE(stream->opening().durable);
    Send(*stream, 0, 40);
    WaitUntilDurable(*stream, 40);
    ASSERT_TRUE(testing_support::Eventually([&] {
      const MapSnapshot map = Export(session);
      return map.objects.size() == 4 && std::all_of(map.objects.begin(), map.objects.end(),
                                                    [](const auto& object) { return object.mesh.has_value(); });
    }));
  }
  StartService();
  const auto listed = service_->ListSessions().value();
  ASSERT_THAT(listed, SizeIs(1));
  EXPECT_EQ(listed[0].name, "table");
  EXPECT_EQ(listed[0].state, SessionState::kOpen);
  EXPECT_TRUE(listed[0].durable);
  EXPECT_EQ(listed[0].statistics.frames_processed, 40u);
  const MapSnapshot stored = Export(session);
  ASSERT_THAT(stored.objects, SizeIs(4));
  for (const ObjectSnapshot& object : stored.objects) EXPECT_TRUE(object.mesh.has_value());
  EXPECT_THAT(stored.trajectory, SizeIs(40));
  const auto watch = service_->Watch(session).value();
  EXPECT_THAT(watch->opening().objects, SizeIs(4));

  const auto first_try = service_->OpenMap(session);
  EXPECT_EQ(first_try.status().code(), absl::StatusCode::kUnavailable);
  const auto stream = Open(session);
  ASSERT_NE(stream, nullptr);
  EXPECT_EQ(stream->opening().newest_frame_id, 40u);
  FrameInput again = testing_support::MakeWorldInput(world_, 39);
  again.resent = true;
  ASSERT_TRUE(stream->Send(again).ok());
  EXPECT_TRUE(testing_support::NextOf<FrameAck>(*stream)->duplicate);
  Send(*stream, 40, 60);
  WaitUntilDurable(*stream, 60);
  EXPECT_EQ(IdsOf(Export(session)), IdsOf(stored)) << "the same objects, and none twice";
  EXPECT_TRUE(service_->FinishSession(session).ok());
  testing_support::ReadToEnd(*stream);
  const MapSnapshot finished = Export(session);
  EXPECT_EQ(finished.state, SessionState::kFinished);
  EXPECT_THAT(finished.trajectory, SizeIs(60));

  // Who watched the stored map sees the same objects go on.
  client::MapCopy copy;
  for (const MapEvent& event : testing_support::ReadToEnd(*watch)) copy.Apply(event);
  EXPECT_TRUE(watch->status().ok()) << Message(watch->status());
  ASSERT_EQ(copy.objects().size(), finished.objects.size());
  for (const ObjectSnapshot& object : finished.objects) {
    const ObjectSnapshot& copied = copy.objects().at(object.object.id);
    EXPECT_EQ(copied.object.revision, object.object.revision);
    EXPECT_EQ(copied.mesh->draco, object.mesh->draco);
  }
}

TEST_F(RestoreTest, AFinishedSessionStaysAsItIs) {
  StartService();
  const std::string session = NewSession();
  {
    const auto stream = Open(session);
    Send(*stream, 0, 25);
    EXPECT_TRUE(service_->FinishSession(session).ok());
    testing_support::ReadToEnd(*stream);
  }
  const MapSnapshot before = Export(session);
  ASSERT_THAT(before.objects, Not(IsEmpty()));
  StartService();
  const MapSnapshot after = Export(session);
  EXPECT_EQ(after.state, SessionState::kFinished);
  ASSERT_EQ(after.objects.size(), before.objects.size());
  for (size_t i = 0; i < after.objects.size(); ++i) {
    EXPECT_EQ(after.objects[i].object.revision, before.objects[i].object.revision);
    EXPECT_EQ(after.objects[i].mesh->draco, before.objects[i].mesh->draco);
  }
  EXPECT_EQ(after.trajectory.size(), before.trajectory.size());
  EXPECT_EQ(service_->OpenMap(session).status().code(), absl::StatusCode::kFailedPrecondition);
  const auto watch = service_->Watch(session).value();
  EXPECT_THAT(testing_support::Only<MeshUpdate>(testing_support::ReadToEnd(*watch)), SizeIs(after.objects.size()));
  EXPECT_TRUE(watch->status().ok());
  EXPECT_TRUE(service_->DeleteSession(session).ok());
  StartService();
  EXPECT_THAT(service_->ListSessions().value(), IsEmpty());
}

TEST_F(RestoreTest, ASessionThatWasFinishingIsCompleted) {
  StartService();
  const std::string session = NewSession();
  {
    const auto stream = Open(session);
    Send(*stream, 0, 25);
    WaitUntilDurable(*stream, 25);
  }
  StartService();
  EXPECT_EQ(service_->FinishSession(session)->state, SessionState::kRestoring);
  StartService();  // before the session was restored
  EXPECT_TRUE(
      testing_support::Eventually([&] { return service_->GetSession(session)->state == SessionState::kFinished; }));
  EXPECT_THAT(Export(session).objects, Not(IsEmpty()));
}

TEST_F(RestoreTest, DeletedWhileItIsRestored) {
  StartService();
  const std::string session = NewSession();
  {
    const auto stream = Open(session);
    Send(*stream, 0, 20);
    WaitUntilDurable(*stream, 20);
  }
  StartService();
  EXPECT_EQ(service_->OpenMap(session).status().code(), absl::StatusCode::kUnavailable);
  EXPECT_TRUE(service_->DeleteSession(session).ok());
  EXPECT_EQ(service_->OpenMap(session).status().code(), absl::StatusCode::kNotFound);
  StartService();
  EXPECT_THAT(service_->ListSessions().value(), IsEmpty());
}

}  // namespace romap::session::restore_test
