// A client whose link to the server is cut and stalled at random while it maps.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <atomic>
#include <cstdlib>
#include <numeric>
#include <random>
#include <thread>

#include "client/sdk/resuming_map_stream.h"
#include "client/sdk/retry.h"
#include "tests/integration/recording_client.h"
#include "tests/integration/server_process.h"
#include "tests/support/link_proxy.h"
#include "tests/support/synthetic_world.h"
#include "tests/support/world_input.h"

namespace romap::link_cut_test {

using std::chrono::milliseconds;
using ::testing::SizeIs;

constexpr int kMasksDelay = 2;  // frames

struct Damage {
  int count = 4;
  milliseconds max{500};
};

// ROMAP_TEST_CUTS: their number, for longer runs with cuts of up to 10 s.
Damage DamageToDo() {
  const char* text = std::getenv("ROMAP_TEST_CUTS");
  return text != nullptr ? Damage{.count = std::atoi(text), .max = milliseconds(10'000)} : Damage{};
}

class LinkCutTest : public ::testing::Test {
 protected:
  LinkCutTest() {
    const SyntheticWorld world(integration::SmallWorld());
    camera_ = world.camera();
    for (int i = 0; i < world.frame_count(); ++i) inputs_.push_back(testing_support::MakeWorldInput(world, i));
  }

  // The camera goes to and fro along its path.
  FrameInput MakeInput(uint64_t id) const {
    const size_t period = 2 * (inputs_.size() - 1);
    const size_t step = (id - 1) % period;
    FrameInput input = inputs_[std::min(step, period - step)];
    input.frame_id = id;
    input.timestamp_ns = static_cast<int64_t>(id) * std::chrono::nanoseconds(integration::kFramePeriod).count();
    return input;
  }

  // Returns when the link works again.
  void DamageLink(const Damage& damage, uint32_t seed) {
    std::mt19937 random(seed);
    const auto between = [&](milliseconds low, milliseconds high) {
      return milliseconds(std::uniform_int_distribution<int64_t>(low.count(), high.count())(random));
    };
    for (int i = 0; i < damage.count; ++i) {
      proxy_->SetDelay(between(milliseconds(0), milliseconds(3)));
      // In a long cut, the delays between attempts grow to some seconds.
      std::this_thread::sleep_for(between(milliseconds(200), std::max(milliseconds(900), damage.max / 2)));
      const milliseconds duration = between(milliseconds(100), damage.max);
      if (i % 3 == 2) {
        proxy_->Stall(true);
        std::this_thread::sleep_for(duration);
        proxy_->Stall(false);
      } else {
        ++cuts_;
        proxy_->Cut(duration);
        std::this_thread::sleep_for(duration);
      }
    }
    proxy_->SetDelay(milliseconds(0));
  }

  // Sends frames in the pace of a camera while the link is damaged, the masks of every third frame late. Returns the
  // number of frames.
  uint64_t SendWhile(const std::atomic<bool>& damaging, MapStream& stream) const {
    const auto start = std::chrono::steady_clock::now();
    uint64_t frames = 0;
    std::map<uint64_t, MasksInput> late;  // by the frame after which they are sent
    while (damaging || frames < inputs_.size()) {
      FrameInput input = MakeInput(++frames);
      if (frames % 3 == 0) {
        MasksInput& masks = late[frames + kMasksDelay];
        masks.frame_id = frames;
        static_cast<EncodedMasks&>(masks) = std::exchange(static_cast<EncodedMasks&>(input), {});
      }
      std::this_thread::sleep_until(start + frames * integration::kFramePeriod);
      EXPECT_OK(stream.Send(std::move(input)));
      if (const auto masks = late.find(frames); masks != late.end()) {
        EXPECT_OK(stream.SendMasks(std::move(masks->second)));
        late.erase(masks);
      }
    }
    for (auto& [after, masks] : late) EXPECT_OK(stream.SendMasks(std::move(masks)));
    return frames;
  }

  // Waits while the server gets on with what has waited for the link.
  static void WaitUntilSettled(const client::ResumingMapStream& stream) {
    size_t unsettled = stream.unsettled();
    while (unsettled > 0) {
      if (!testing_support::Eventually([&] { return stream.unsettled() < unsettled; })) return;
      unsettled = stream.unsettled();
    }
  }

  testing_support::TemporaryFolder folder_;
  integration::ServerProcess server_{folder_ / "data"};
  std::unique_ptr<testing_support::LinkProxy> proxy_ = std::make_unique<testing_support::LinkProxy>(server_.address());
  CameraModel camera_;
  std::vector<FrameInput> inputs_;
  int cuts_ = 0;
};

TEST_F(LinkCutTest, InputsArriveOnceAndTheCopiesEqualTheMap) {
  const Damage damage = DamageToDo();
  const uint32_t seed = std::random_device{}();
  SCOPED_TRACE(fmt::format("{} interruptions with seed {}", damage.count, seed));
  const auto client = client::RemoteMappingService::Connect(proxy_->address()).value();
  SessionOptions options;
  options.camera = camera_;
  const std::string session = client->CreateSession(options)->id;
  auto opened = client::ResumingMapStream::Open(client.get(), session);
  ASSERT_TRUE(opened.ok()) << Message(opened.status());
  client::ResumingMapStream* const stream = opened->get();
  integration::RecordingClient recorder(*std::move(opened));
  integration::RecordingWatcher watcher(client.get(), session);

  std::atomic<bool> damaging = true;
  std::thread damager([&] {
    DamageLink(damage, seed);
    damaging = false;
  });
  const uint64_t frames = SendWhile(damaging, *stream);
  damager.join();
  WaitUntilSettled(*stream);
  proxy_->Cut(milliseconds(100));
  EXPECT_OK(client::RetryWhileUnavailable([&] { return client->FinishSession(session); }).status());
  ASSERT_TRUE(recorder.WaitForEnd());
  EXPECT_OK(stream->status());
  const client::MapCopy watched = watcher.WaitForEnd();

  std::vector<uint64_t> ids(frames), ids_of_masks;
  std::iota(ids.begin(), ids.end(), 1);
  for (uint64_t id = 3; id <= frames; id += 3) ids_of_masks.push_back(id);
  EXPECT_EQ(recorder.AcceptedFrames(), ids);
  EXPECT_EQ(recorder.AcceptedMasks(), ids_of_masks);
  const auto direct = server_.Connect();
  const integration::StoredIds stored = integration::StoredInputs(*direct, session);
  EXPECT_EQ(stored.frames, ids);
  EXPECT_EQ(stored.masks, ids_of_masks);

  const MapSnapshot map = direct->ExportMap(session).value();
  EXPECT_EQ(map.state, SessionState::kFinished);
  EXPECT_EQ(map.statistics.frames_received, frames);
  EXPECT_THAT(map.objects, SizeIs(4));
  integration::ExpectEqual(recorder.copy(), map);
  integration::ExpectEqual(watched, map);
  ASSERT_EQ(map.trajectory.size(), frames);
  size_t compared = 0;
  for (uint64_t i = 0; i < frames; ++i) {
    const FrameAck& ack = recorder.frame_acks().at(i + 1).front();
    ASSERT_EQ(map.trajectory[i].frame_id, i + 1);
    if (ack.duplicate) continue;  // its pose was lost with the connection
    ++compared;
    ASSERT_TRUE(ack.T_world_camera.has_value()) << ack.frame_id;
    EXPECT_TRUE(ack.T_world_camera->Matrix().isApprox(map.trajectory[i].T_world_camera->Matrix(), 1e-6)) << i + 1;
  }
  EXPECT_GT(compared, 0u);
  EXPECT_GE(watcher.streams(), cuts_ > 0 ? 2 : 1);
  fmt::print("{} cuts and {} stalls, {} frames, {} connections, {} poses compared\n", cuts_, damage.count - cuts_,
             frames, proxy_->connections(), compared);
}

}  // namespace romap::link_cut_test
