#pragma once

#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "client/sdk/map_copy.h"
#include "common/mapping_service.h"
#include "tests/support/checked_copy.h"
#include "tests/support/sanitizer.h"
#include "tests/support/streams.h"
#include "tests/support/synthetic_world.h"

namespace romap::integration {

// Of a live camera. Under a sanitizer, a server could process only few of the frames of a faster one.
inline constexpr std::chrono::milliseconds kFramePeriod{testing_support::kUnderSanitizer ? 400 : 40};

// Small images, for tests that are about the service and not about the map.
inline SyntheticWorldOptions SmallWorld() {
  SyntheticWorldOptions options;
  options.width_px = 160;
  options.height_px = 120;
  options.focal_px = 150;
  return options;
}

// Reads the events of a Map stream on a thread of its own and keeps what they said. Thread-safe.
class RecordingClient {
 public:
  explicit RecordingClient(std::unique_ptr<MapStream> stream)
      : stream_(std::move(stream)), thread_([this] { Read(); }) {}
  ~RecordingClient() {
    stream_->Cancel();
    if (thread_.joinable()) thread_.join();
  }

  MapStream& stream() { return *stream_; }
  // Waits until the stream has ended. False, with a test failure, if it does not.
  bool WaitForEnd() {
    const bool ended = testing_support::Eventually([this] { return stream_->Done(); });
    if (!ended) stream_->Cancel();
    thread_.join();
    return ended;
  }

  size_t answered() const {
    std::lock_guard lock(mutex_);
    return frame_acks_.size();
  }
  Durable durable() const {
    std::lock_guard lock(mutex_);
    return durable_;
  }
  // The codes that were announced as events, and those of the newest statistics.
  std::set<std::string> announced() const {
    std::lock_guard lock(mutex_);
    return announced_;
  }
  std::set<std::string> current() const {
    std::lock_guard lock(mutex_);
    return current_;
  }

  // The rest only after WaitForEnd().

  // Ids of the inputs with an acknowledgement. Adds a failure if one has several, and, if `may_drop` is false, if one
  // was not accepted.
  std::vector<uint64_t> AcceptedFrames(bool may_drop = false) const { return Accepted(frame_acks_, may_drop); }
  std::vector<uint64_t> AcceptedMasks(bool may_drop = false) const { return Accepted(masks_acks_, may_drop); }
  const std::map<uint64_t, std::vector<FrameAck>>& frame_acks() const { return frame_acks_; }
  const client::MapCopy& copy() const { return copy_; }

 private:
  void Read() {
    while (!stream_->Done()) {
      const std::optional<MapEvent> event = stream_->Next(std::chrono::milliseconds(100));
      if (!event) continue;
      std::lock_guard lock(mutex_);
      copy_.Apply(*event);
      if (const auto* ack = std::get_if<FrameAck>(&*event)) frame_acks_[ack->frame_id].push_back(*ack);
      if (const auto* ack = std::get_if<MasksAck>(&*event)) masks_acks_[ack->frame_id].push_back(*ack);
      if (const auto* durable = std::get_if<Durable>(&*event)) durable_ = *durable;
      if (const auto* diagnostic = std::get_if<Diagnostic>(&*event)) announced_.insert(diagnostic->code);
      if (const auto* statistics = std::get_if<Statistics>(&*event)) {
        current_.clear();
        for (const Diagnostic& diagnostic : statistics->diagnostics) current_.insert(diagnostic.code);
      }
    }
  }

  template <class Ack>
  static std::vector<uint64_t> Accepted(const std::map<uint64_t, std::vector<Ack>>& acks, bool may_drop) {
    std::vector<uint64_t> accepted;
    for (const auto& [id, answers] : acks) {
      EXPECT_EQ(answers.size(), 1u) << "frame " << id << " has several acknowledgements";
      EXPECT_TRUE(answers.front().accepted || may_drop) << "frame " << id << ": " << answers.front().error;
      if (answers.front().accepted) accepted.push_back(id);
    }
    return accepted;
  }

  const std::unique_ptr<MapStream> stream_;
  mutable std::mutex mutex_;
  client::MapCopy copy_;
  std::map<uint64_t, std::vector<FrameAck>> frame_acks_;
  std::map<uint64_t, std::vector<MasksAck>> masks_acks_;
  Durable durable_;
  std::set<std::string> announced_, current_;
  std::thread thread_;
};

// Watches a session until it has ended. When the connection breaks, watches again with a new copy.
class RecordingWatcher {
 public:
  // `service` outlives this object.
  RecordingWatcher(MappingService* service, std::string session)
      : service_(service), session_(std::move(session)), thread_([this] { Run(); }) {}
  ~RecordingWatcher() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }

  // Waits until the session has ended and returns the copy of its map.
  client::MapCopy WaitForEnd() {
    testing_support::Eventually([this] { return ended_.load(); });
    stop_ = true;
    thread_.join();
    return copy_;
  }
  int streams() const { return streams_; }

 private:
  void Run() {
    while (!stop_ && !ended_) {
      auto stream = service_->Watch(session_);
      if (!stream.ok()) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        continue;
      }
      ++streams_;
      client::MapCopy copy;
      while (!stop_ && !(*stream)->Done()) {
        if (const auto event = (*stream)->Next(std::chrono::milliseconds(100))) copy.Apply(*event);
      }
      if (stop_ || !(*stream)->status().ok()) continue;
      copy_ = std::move(copy);
      ended_ = true;
    }
  }

  MappingService* const service_;
  const std::string session_;
  std::atomic<bool> stop_ = false, ended_ = false;
  std::atomic<int> streams_ = 0;
  client::MapCopy copy_;
  std::thread thread_;
};

// Compares all fields of the objects that an export contains: those that are confirmed or lost.
inline void ExpectEqual(const client::MapCopy& copy, const MapSnapshot& map) {
  std::map<ObjectId, std::string> copied, exported;
  for (const auto& [id, object] : copy.objects()) {
    if (object.object.state != ObjectState::kProvisional) {
      copied[id] = testing_support::CheckedCopy::ToBytes(object);
    }
  }
  for (const ObjectSnapshot& object : map.objects) {
    exported[object.object.id] = testing_support::CheckedCopy::ToBytes(object);
  }
  std::set<ObjectId> copied_ids, exported_ids;
  for (const auto& [id, bytes] : copied) copied_ids.insert(id);
  for (const auto& [id, bytes] : exported) exported_ids.insert(id);
  EXPECT_EQ(copied_ids, exported_ids);
  for (const auto& [id, bytes] : exported) {
    EXPECT_TRUE(copied[id] == bytes) << id << " differs, revision " << copy.objects().at(id).object.revision;
  }
}

}  // namespace romap::integration
