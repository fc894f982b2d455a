#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "common/client_input.h"

namespace romap::cli {

// Simulates a detector that is slower than the camera: limits the rate of frames with masks, and delays the masks. All
// times are frame timestamps.
class MaskSchedule {
 public:
  struct LateMasks {
    int64_t due_ns = 0;
    MasksInput masks;
  };

  // `rate_hz`: maximum rate of frames with masks; 0 = unlimited. `delay_s`: delay of the masks; 0 = send with the
  // frame.
  MaskSchedule(double rate_hz, double delay_s) : rate_hz_(rate_hz), delay_s_(delay_s) {}

  // Removes the masks from the frame if they are dropped or delayed. Call for every frame, in order.
  void Apply(FrameInput& frame);
  // Returns the oldest delayed masks if they are due by `timestamp_ns`; otherwise nullopt.
  std::optional<LateMasks> TakeDueBy(int64_t timestamp_ns);

 private:
  // Whether the detector processes the frame with this timestamp.
  bool DetectorRuns(int64_t timestamp_ns);

  const double rate_hz_, delay_s_;
  std::optional<int64_t> first_timestamp_ns_;
  int64_t last_period_ = -1;
  std::deque<LateMasks> delayed_;
};

}  // namespace romap::cli
