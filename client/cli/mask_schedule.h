#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "common/client_input.h"

namespace romap::cli {

// Plays a detector that is slower than the camera: of the masks that frames carry it keeps so many a second, and holds
// them back for a while. All times are those of the frames' timestamps.
class MaskSchedule {
 public:
  struct LateMasks {
    int64_t due_ns = 0;
    MasksInput masks;
  };

  // `rate_hz` 0: masks of all frames. `delay_s` 0: masks stay in their frames.
  MaskSchedule(double rate_hz, double delay_s) : rate_hz_(rate_hz), delay_s_(delay_s) {}

  // Takes the masks out of the frame where they are not to go with it. Call for every frame, in order.
  void Apply(FrameInput& frame);
  // The oldest masks that are held back, if they are due by then; nullopt otherwise.
  std::optional<LateMasks> TakeDueBy(int64_t timestamp_ns);

 private:
  bool DetectorRuns(int64_t timestamp_ns);

  const double rate_hz_, delay_s_;
  std::optional<int64_t> first_timestamp_ns_;
  int64_t last_slot_ = -1;
  std::deque<LateMasks> held_back_;
};

}  // namespace romap::cli
