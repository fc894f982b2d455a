// A server whose disk is slow, hangs or fails.

#include "tests/integration/slow_disk.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cerrno>
#include <numeric>
#include <thread>

#include "client/sdk/resuming_map_stream.h"
#include "tests/integration/recording_client.h"
#include "tests/integration/server_process.h"
#include "tests/support/synthetic_world.h"
#include "tests/support/world_input.h"

namespace romap::slow_disk_test {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Not;
using testing_support::Eventually;

class SlowDiskTest : public ::testing::Test {
 protected:
  // A live session: it must never wait for the disk.
  std::string NewSession(MappingService& service) const {
    SessionOptions options;
    options.camera = world_.camera();
    options.mode = FrameMode::kLive;
    const auto created = service.CreateSession(options);
    EXPECT_TRUE(created.ok()) << Message(created.status());
    return created.ok() ? created->id : "";
  }
  // Sends frames `first` to `last` in the pace of a camera.
  void Send(MapStream& stream, uint64_t first, uint64_t last) const {
    const auto start = std::chrono::steady_clock::now();
    for (uint64_t id = first; id <= last; ++id) {
      std::this_thread::sleep_until(start + integration::kFramePeriod * (id - first));
      EXPECT_OK(stream.Send(testing_support::MakeWorldInput(world_, static_cast<int>(id) - 1)));
    }
  }
  // The stored frames are the accepted ones up to some frame, each once.
  static void ExpectBeginning(const std::vector<uint64_t>& stored, const std::vector<uint64_t>& accepted) {
    ASSERT_LE(stored.size(), accepted.size());
    EXPECT_TRUE(std::equal(stored.begin(), stored.end(), accepted.begin()))
        << ::testing::PrintToString(stored) << " of " << ::testing::PrintToString(accepted);
  }

  testing_support::TemporaryFolder folder_;
  integration::SlowDisk disk_{folder_ / "disk"};
  integration::ServerProcess server_{folder_ / "data", disk_.environment()};
  const SyntheticWorld world_{integration::SmallWorld()};
};

TEST_F(SlowDiskTest, TheSessionGoesOnWhileTheDiskHangs) {
  const auto service = server_.Connect();
  const std::string session = NewSession(*service);
  integration::RecordingClient client(service->OpenMap(session).value());
  disk_.SetRule("hang");
  Send(client.stream(), 1, 30);
  EXPECT_TRUE(Eventually([&] { return client.answered() == 30; }));
  EXPECT_EQ(client.durable().frame_id, 0u) << "the disk does not have it";
  EXPECT_TRUE(service->ExportMap(session).ok());
  EXPECT_TRUE(service->ListSessions().ok());
  EXPECT_TRUE(Eventually([&] { return !service->ExportMap(session)->objects.empty(); }));
  EXPECT_EQ(client.durable().frame_id, 0u);
  disk_.SetRule("");
  EXPECT_TRUE(Eventually([&] { return client.durable().frame_id == 30; }));
}

TEST_F(SlowDiskTest, AKillLosesNothingThatIsDurable) {
  const auto service = server_.Connect();
  const std::string session = NewSession(*service);
  disk_.SetRule("delay 500");
  integration::RecordingClient client(service->OpenMap(session).value());
  std::thread sender([&] { Send(client.stream(), 1, 30); });
  EXPECT_TRUE(Eventually([&] { return client.durable().frame_id > 0; }));
  sender.join();
  EXPECT_TRUE(Eventually([&] { return client.answered() == 30; }));
  server_.Kill();
  ASSERT_TRUE(client.WaitForEnd());
  const uint64_t durable = client.durable().frame_id;
  disk_.SetRule("");
  server_.Start();

  const std::vector<uint64_t> accepted = client.AcceptedFrames(/*may_drop=*/true);
  const std::vector<uint64_t> stored = integration::StoredInputs(*service, session).frames;
  ExpectBeginning(stored, accepted);
  EXPECT_THAT(stored, Contains(durable));
  client::ResumingMapStream::Open(service.get(), session).value()->Cancel();  // waits until it is restored
  const MapSnapshot map = service->ExportMap(session).value();
  std::vector<uint64_t> tracked;
  for (const FrameAck& frame : map.trajectory) tracked.push_back(frame.frame_id);
  EXPECT_EQ(tracked, stored);
}

struct Failure {
  const char* name;
  std::string rule;
};

class FailingDiskTest : public SlowDiskTest, public ::testing::WithParamInterface<Failure> {};
INSTANTIATE_TEST_SUITE_P(All, FailingDiskTest,
                         ::testing::Values(Failure{"Broken", fmt::format("fail {}", EIO)},
                                           Failure{"Full", fmt::format("fail {}", ENOSPC)},
                                           Failure{"BrokenForTheCatalog", fmt::format("fail {} -wal", EIO)},
                                           Failure{"FullForTheInputs", fmt::format("fail {} .seg", ENOSPC)}),
                         [](const auto& info) { return info.param.name; });

TEST_P(FailingDiskTest, TheSessionGoesOnAndIsStoredLater) {
  const auto service = server_.Connect();
  const std::string session = NewSession(*service);
  integration::RecordingClient client(service->OpenMap(session).value());
  Send(client.stream(), 1, 5);
  EXPECT_TRUE(Eventually([&] { return client.durable().frame_id == 5; }));

  disk_.SetRule(GetParam().rule);
  Send(client.stream(), 6, 20);
  EXPECT_TRUE(Eventually([&] { return client.answered() == 20; }));
  EXPECT_TRUE(Eventually([&] { return client.current().contains("not_durable"); }));
  EXPECT_THAT(client.announced(), Contains("not_durable"));
  EXPECT_LT(client.durable().frame_id, 20u);

  disk_.SetRule("");
  EXPECT_TRUE(Eventually([&] { return client.durable().frame_id == 20; }));
  EXPECT_TRUE(Eventually([&] { return !client.current().contains("not_durable"); }));
  Send(client.stream(), 21, 25);
  EXPECT_TRUE(Eventually([&] { return client.durable().frame_id == 25; }));
  EXPECT_THAT(client.current(), Not(Contains("inputs_not_stored")));

  // Killed while the disk fails again.
  disk_.SetRule(GetParam().rule);
  Send(client.stream(), 26, 35);
  EXPECT_TRUE(Eventually([&] { return client.answered() == 35; }));
  EXPECT_TRUE(Eventually([&] { return client.current().contains("not_durable"); }));
  server_.Kill();
  ASSERT_TRUE(client.WaitForEnd());
  disk_.SetRule("");
  server_.Start();
  const std::vector<uint64_t> accepted = client.AcceptedFrames(/*may_drop=*/true);
  const std::vector<uint64_t> stored = integration::StoredInputs(*service, session).frames;
  ExpectBeginning(stored, accepted);
  EXPECT_THAT(stored, Contains(25u));
}

}  // namespace romap::slow_disk_test
