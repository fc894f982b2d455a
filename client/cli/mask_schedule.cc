#include "client/cli/mask_schedule.h"

#include <cmath>
#include <utility>

namespace romap::cli {

// The first frame with masks in each period of the rate gets its turn.
bool MaskSchedule::DetectorRuns(int64_t timestamp_ns) {
  if (rate_hz_ == 0) return true;
  if (!first_timestamp_ns_) first_timestamp_ns_ = timestamp_ns;
  // Timestamps are rounded: a frame that is a microsecond early still begins the next period.
  const double elapsed_s = 1e-9 * static_cast<double>(timestamp_ns - *first_timestamp_ns_) + 1e-6;
  const auto slot = static_cast<int64_t>(std::floor(elapsed_s * rate_hz_));
  return std::exchange(last_slot_, slot) != slot;
}

void MaskSchedule::Apply(FrameInput& frame) {
  if (frame.mask_encoding == MaskEncoding::kNone) return;
  EncodedMasks& masks = frame;
  if (!DetectorRuns(frame.timestamp_ns)) {
    masks = {};
    return;
  }
  if (delay_s_ == 0) return;
  LateMasks late;
  late.due_ns = frame.timestamp_ns + std::llround(1e9 * delay_s_);
  late.masks.frame_id = frame.frame_id;
  static_cast<EncodedMasks&>(late.masks) = std::exchange(masks, {});
  held_back_.push_back(std::move(late));
}

std::optional<MaskSchedule::LateMasks> MaskSchedule::TakeDueBy(int64_t timestamp_ns) {
  if (held_back_.empty() || held_back_.front().due_ns > timestamp_ns) return std::nullopt;
  std::optional<LateMasks> due(std::move(held_back_.front()));
  held_back_.pop_front();
  return due;
}

}  // namespace romap::cli
