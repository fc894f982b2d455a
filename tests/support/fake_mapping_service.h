#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "common/mapping_service.h"

namespace romap::testing_support {

class FakeSession;

// A fake of the mapping service for tests of its clients. It fulfills the contract of MappingService and does the
// following:
//   - Send() acknowledges every frame immediately: frames with an image are accepted, others are rejected.
//   - SendMasks() acknowledges late masks immediately: those of an accepted frame without masks are accepted.
//   - There is one confirmed object per class name of the instances. Every frame with an instance of that class
//     publishes an update and a mesh with a higher revision.
//   - A session finishes immediately.
// Thread-safe; starts no threads.
class FakeMappingService : public MappingService {
 public:
  FakeMappingService();
  ~FakeMappingService() override;

  // Called within Send() before a frame is processed; may block to simulate a busy server. Set before the first frame.
  void SetFrameHook(std::function<void(const FrameInput&)> hook) { frame_hook_ = std::move(hook); }
  // The streams say that the service stores inputs. Durable events come only from PublishDurable(). Set before a
  // stream.
  void SetDurable(bool durable) { durable_ = durable; }
  void PublishDurable(const std::string& session_id, const Durable& durable);
  // OpenMap() fails with `status` until it is OK.
  void RefuseStreams(const absl::Status& status);
  // Ends the open streams of all sessions as a broken connection does.
  void BreakStreams(const absl::Status& status);
  // The same, as a crash does: the sessions forget the frames after `newest_frame_id` and all objects.
  void Crash(uint64_t newest_frame_id);

  absl::StatusOr<SessionInfo> CreateSession(const SessionOptions& options) override;
  absl::StatusOr<std::vector<SessionInfo>> ListSessions() override;
  absl::StatusOr<SessionInfo> GetSession(const std::string& session_id) override;
  absl::StatusOr<SessionInfo> FinishSession(const std::string& session_id) override;
  absl::Status DeleteSession(const std::string& session_id) override;
  using MappingService::LoadSession;
  using MappingService::OpenMap;
  absl::StatusOr<std::unique_ptr<MapStream>> OpenMap(const std::string& session_id,
                                                     const std::string& resume_token) override;
  absl::StatusOr<std::unique_ptr<EventStream>> Watch(const std::string& session_id) override;
  absl::StatusOr<MapSnapshot> ExportMap(const std::string& session_id) override;
  absl::Status SaveSession(const std::string& session_id, const PieceWriter& write) override;
  absl::StatusOr<SessionInfo> LoadSession(const PieceReader& read, const std::string& tenant) override;
  absl::StatusOr<SessionInfo> PinSession(const std::string& session_id, bool pinned) override;

 private:
  absl::StatusOr<std::shared_ptr<FakeSession>> Find(const std::string& session_id);

  std::function<void(const FrameInput&)> frame_hook_ = [](const FrameInput&) {};
  std::mutex mutex_;
  uint64_t sessions_created_ = 0;
  bool durable_ = false;
  absl::Status refusal_;
  std::map<std::string, std::shared_ptr<FakeSession>> sessions_;
};

}  // namespace romap::testing_support
