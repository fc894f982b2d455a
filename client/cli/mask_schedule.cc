#include "client/cli/mask_schedule.h"

#include <cmath>
#include <utility>

namespace romap::cli {

// The detector processes the first frame with masks in each period of the rate.
bool MaskSchedule::DetectorRuns(int64_t timestamp_ns) {
  if (rate_hz_ == 0) return true;
  if (!first_timestamp_ns_) first_timestamp_ns_ = timestamp_ns;
  // Tolerance for rounded timestamps: a frame that is one microsecond early starts the next period.
  const double elapsed_s = 1e-9 * static_cast<double>(timestamp_ns - *first_timestamp_ns_) + 1e-6;
  const auto period = static_cast<int64_t>(std::floor(elapsed_s * rate_hz_));
  return std::exchange(last_period_, period) != period;
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
  delayed_.push_back(std::move(late));
}

std::optional<MaskSchedule::LateMasks> MaskSchedule::TakeDueBy(int64_t timestamp_ns) {
  if (delayed_.empty() || delayed_.front().due_ns > timestamp_ns) return std::nullopt;
  std::optional<LateMasks> due(std::move(delayed_.front()));
  delayed_.pop_front();
  return due;
}

}  // namespace romap::cli
