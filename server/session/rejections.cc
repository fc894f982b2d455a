#include "server/session/rejections.h"

#include <fmt/format.h>

#include "common/status.h"

namespace romap::session {
namespace {

constexpr double kMaxRejectedShare = 0.2;

}  // namespace

void Rejections::Add(uint64_t frame_id, const absl::Status& reason, Rejected* rejected) {
  if (rejected->count++ > 0) return;
  rejected->first_frame_id = frame_id;
  rejected->first_reason = Message(reason);
}

std::vector<Diagnostic> Rejections::Diagnostics() const {
  std::vector<Diagnostic> diagnostics;
  constexpr const char* kAdvice = "correct the client, or repair the file";
  if (frames_.count > 0) {
    const uint64_t received = accepted_frames_ + frames_.count;
    const bool too_many = static_cast<double>(frames_.count) > kMaxRejectedShare * static_cast<double>(received);
    diagnostics.push_back({.code = "frames_rejected",
                           .severity = too_many ? Severity::kError : Severity::kWarning,
                           .first_frame_id = frames_.first_frame_id,
                           .count = frames_.count,
                           .text = fmt::format("{} of {} frames were rejected; the first, frame {}: {}", frames_.count,
                                               received, frames_.first_frame_id, frames_.first_reason),
                           .advice = kAdvice});
  }
  if (masks_.count > 0) {
    diagnostics.push_back({.code = "masks_rejected",
                           .severity = Severity::kWarning,
                           .first_frame_id = masks_.first_frame_id,
                           .count = masks_.count,
                           .text = fmt::format("the late masks of {} frames were rejected; the first, of frame {}: {}",
                                               masks_.count, masks_.first_frame_id, masks_.first_reason),
                           .advice = kAdvice});
  }
  return diagnostics;
}

}  // namespace romap::session
