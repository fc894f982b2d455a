#pragma once

#include <signal.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "client/sdk/remote_mapping_service.h"
#include "common/status.h"
#include "server/store/blob_content.h"
#include "server/store/session_file.h"
#include "tests/integration/quick_run.h"
#include "tests/support/streams.h"
#include "tests/support/subprocess.h"

namespace romap::integration {

// A romap-server that a test kills and starts again on the same data folder and port. Trains little.
class ServerProcess {
 public:
  // `environment`: assignments NAME=VALUE for the process.
  explicit ServerProcess(std::string data_dir, std::vector<std::string> environment = {})
      : data_dir_(std::move(data_dir)), environment_(std::move(environment)) {
    Start();
  }

  const std::string& address() const { return address_; }
  const std::string& data_dir() const { return data_dir_; }

  void Kill() {
    process_->Signal(SIGKILL);
    process_->Wait();
  }
  // As an operator stops it.
  void Stop() {
    process_->Signal(SIGTERM);
    EXPECT_EQ(process_->Wait().exit_code, 0);
  }
  void Start() {
    std::vector<std::string> command{"/usr/bin/env"};
    command.insert(command.end(), environment_.begin(), environment_.end());
    command.insert(command.end(), {ROMAP_SERVER, "--listen", address_, "--http", "", "--data-dir", data_dir_});
    process_ = std::make_unique<testing_support::BackgroundProcess>(WithLittleTraining(std::move(command)));
    address_ = process_->WaitForLine("romap-server listening on ");
  }
  void KillAndStart() {
    Kill();
    Start();
  }
  std::unique_ptr<client::RemoteMappingService> Connect() const {
    auto service = client::RemoteMappingService::Connect(address_, {.wait = std::chrono::seconds(30)});
    EXPECT_TRUE(service.ok()) << Message(service.status());
    return service.ok() ? *std::move(service) : nullptr;
  }

 private:
  const std::string data_dir_;
  const std::vector<std::string> environment_;
  std::string address_ = "127.0.0.1:0";
  std::unique_ptr<testing_support::BackgroundProcess> process_;
};

// The frame ids of the inputs that the server has stored, in the order in which it accepted them.
struct StoredIds {
  std::vector<uint64_t> frames, masks;
};

// Reads the whole session, so a failure is added if anything of it is damaged. `visit` (may be empty) gets the inputs.
inline StoredIds StoredInputs(MappingService& service, const std::string& session,
                              const std::function<void(const SessionInput&)>& visit = {}) {
  StoredIds ids;
  store::SessionFileReader reader([&](store::FileRecord kind, const std::string& content) -> absl::Status {
    if (kind != store::FileRecord::kInput) return absl::OkStatus();
    ROMAP_ASSIGN_OR_RETURN(const SessionInput input, store::ParseInput(content));
    if (visit) visit(input);
    if (const auto* masks = std::get_if<MasksInput>(&input)) {
      ids.masks.push_back(masks->frame_id);
    } else {
      ids.frames.push_back(std::get<FrameInput>(input).frame_id);
    }
    return absl::OkStatus();
  });
  EXPECT_OK(service.SaveSession(session, [&](const std::string& piece) { return reader.Add(piece); }));
  EXPECT_OK(reader.End());
  return ids;
}

}  // namespace romap::integration
