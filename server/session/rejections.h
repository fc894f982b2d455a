#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <string>
#include <vector>

#include "common/diagnostic.h"

namespace romap::session {

// States how many frames and late masks of a session were rejected. Rejections of a few frames are a warning; if more
// than a fifth of the frames is rejected, the map is not that of the recording, which is an error. Not thread-safe.
class Rejections {
 public:
  void CountAcceptedFrame() { ++accepted_frames_; }
  void AddFrame(uint64_t frame_id, const absl::Status& reason) { Add(frame_id, reason, &frames_); }
  void AddMasks(uint64_t frame_id, const absl::Status& reason) { Add(frame_id, reason, &masks_); }

  // frames_rejected and masks_rejected. Empty if nothing was rejected.
  std::vector<Diagnostic> Diagnostics() const;

 private:
  struct Rejected {
    uint64_t count = 0;
    uint64_t first_frame_id = 0;
    std::string first_reason = {};
  };
  static void Add(uint64_t frame_id, const absl::Status& reason, Rejected* rejected);

  uint64_t accepted_frames_ = 0;
  Rejected frames_, masks_;
};

}  // namespace romap::session
