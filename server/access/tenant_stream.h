#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "common/mapping_service.h"
#include "server/access/tenant_limits.h"

namespace romap::access {

// A MapStream within the limits of its tenant: an input that comes too early waits, which slows the client down, as an
// input queue that is full does.
class TenantStream : public MapStream {
 public:
  // `check_room` is called now and then; an error ends the sending.
  TenantStream(std::unique_ptr<MapStream> stream, std::shared_ptr<TenantLimits> limits,
               std::function<absl::Status()> check_room)
      : stream_(std::move(stream)), limits_(std::move(limits)), check_room_(std::move(check_room)) {}

  absl::Status Send(FrameInput frame) override;
  absl::Status SendMasks(MasksInput masks) override;
  absl::Status CloseSend() override { return stream_->CloseSend(); }
  const StreamOpening& opening() const override { return stream_->opening(); }
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout) override { return stream_->Next(timeout); }
  bool Done() const override { return stream_->Done(); }
  absl::Status status() const override { return stream_->status(); }
  void Cancel() override;

 private:
  absl::Status Admit(size_t bytes);

  const std::unique_ptr<MapStream> stream_;
  const std::shared_ptr<TenantLimits> limits_;
  const std::function<absl::Status()> check_room_;
  RateLimit::Clock::time_point next_check_ = RateLimit::Clock::now();  // the sender's

  std::mutex mutex_;
  std::condition_variable cancelled_changed_;
  bool cancelled_ = false;
};

}  // namespace romap::access
