#include "server/access/tenant_stream.h"

#include <algorithm>

#include "common/status.h"

namespace romap::access {
namespace {

constexpr std::chrono::seconds kRoomCheckPeriod{5};

size_t Bytes(const EncodedMasks& masks) {
  return masks.label_png.size() + masks.label_runs.size() * sizeof(masks.label_runs[0]);
}

}  // namespace

absl::Status TenantStream::Send(FrameInput frame) {
  ROMAP_RETURN_IF_ERROR(Admit(frame.image.size() + frame.depth.size() + Bytes(frame)));
  return stream_->Send(std::move(frame));
}

absl::Status TenantStream::SendMasks(MasksInput masks) {
  ROMAP_RETURN_IF_ERROR(Admit(Bytes(masks)));
  return stream_->SendMasks(std::move(masks));
}

void TenantStream::Cancel() {
  {
    std::lock_guard lock(mutex_);
    cancelled_ = true;
  }
  cancelled_changed_.notify_all();
  stream_->Cancel();
}

absl::Status TenantStream::Admit(size_t bytes) {
  const auto now = RateLimit::Clock::now();
  if (now >= next_check_) {
    ROMAP_RETURN_IF_ERROR(check_room_());
    next_check_ = now + kRoomCheckPeriod;
  }
  const auto wait = std::max(limits_->inputs.Take(1, now), limits_->input_bytes.Take(static_cast<double>(bytes), now));
  if (wait.count() == 0) return absl::OkStatus();
  std::unique_lock lock(mutex_);
  // The stream reports why it ended.
  cancelled_changed_.wait_for(lock, wait, [&] { return cancelled_; });
  return absl::OkStatus();
}

}  // namespace romap::access
