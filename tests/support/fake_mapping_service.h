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

namespace romap::testing {

class FakeSession;

// A mapping service that does no mapping, for tests of whatever stands in front of one. Keeps the promises of
// MappingService, and
//   - answers every frame within Send(): a frame with an image is accepted, one without is not; and late masks within
//     SendMasks(): those of an accepted frame without masks are accepted;
//   - makes one confirmed object per class name among the instances, and with every frame that shows it sends an update
//     and a mesh of it, each with a higher revision;
//   - finishes a session at once.
// Thread-safe; has no threads of its own.
class FakeMappingService : public MappingService {
 public:
  FakeMappingService();
  ~FakeMappingService() override;

  // Called within Send() before a frame is looked at; may block, to play a busy server. Set before the first frame.
  void SetFrameHook(std::function<void(const FrameInput&)> hook) { frame_hook_ = std::move(hook); }

  absl::StatusOr<SessionInfo> CreateSession(const SessionOptions& options) override;
  absl::StatusOr<std::vector<SessionInfo>> ListSessions() override;
  absl::StatusOr<SessionInfo> GetSession(const std::string& session_id) override;
  absl::StatusOr<SessionInfo> FinishSession(const std::string& session_id) override;
  absl::Status DeleteSession(const std::string& session_id) override;
  absl::StatusOr<std::unique_ptr<MapStream>> OpenMap(const std::string& session_id) override;
  absl::StatusOr<std::unique_ptr<EventStream>> Watch(const std::string& session_id) override;
  absl::StatusOr<MapSnapshot> ExportMap(const std::string& session_id) override;

 private:
  absl::StatusOr<std::shared_ptr<FakeSession>> Find(const std::string& session_id);

  std::function<void(const FrameInput&)> frame_hook_ = [](const FrameInput&) {};
  std::mutex mutex_;
  uint64_t sessions_made_ = 0;
  std::map<std::string, std::shared_ptr<FakeSession>> sessions_;
};

}  // namespace romap::testing
