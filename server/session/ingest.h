#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <deque>
#include <memory>

#include "common/client_input.h"
#include "common/lens.h"
#include "common/stage_messages.h"

namespace romap::session {

// First step of a frame's life: decodes, validates and undistorts. Remembers the last accepted id and time, so that
// frames cannot go back, and which of the newest frames may still get masks. One per session, used by its tracking
// thread only.
class Ingest {
 public:
  // Masks may come so long after newer frames than their own, by the frames' timestamps.
  Ingest(const CameraModel& camera, double max_mask_delay_s);

  // INVALID_ARGUMENT naming what is wrong with the frame; then the frame counts as never sent.
  absl::StatusOr<std::shared_ptr<const Frame>> Accept(const FrameInput& input);

  // The masks of a frame that was accepted without any. INVALID_ARGUMENT naming what is wrong with them: in themselves,
  // or that there is no such frame, that it has masks, that they come too late. Then they count as never sent.
  absl::StatusOr<FrameMasks> AcceptMasks(const MasksInput& input);

 private:
  struct AcceptedFrame {
    uint64_t frame_id = 0;
    int64_t timestamp_ns = 0;
    bool has_masks = false;
  };

  absl::Status CheckOrder(const FrameInput& input) const;
  absl::StatusOr<AcceptedFrame*> FindMaskless(uint64_t frame_id);
  void Remember(const Frame& frame);
  void Undistort(Frame& frame) const;
  void UndistortNearest(cv::Mat& image) const;

  CameraModel camera_;     // as the client gave it
  UndistortionMaps maps_;  // empty for a pinhole
  double max_mask_delay_s_;
  bool any_forgotten_ = false;
  std::deque<AcceptedFrame> accepted_;  // by id and time; the newest, and those at most the patience behind it
};

}  // namespace romap::session
