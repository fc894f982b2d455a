#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <stop_token>

#include "common/client_input.h"
#include "common/lens.h"
#include "common/sample_range.h"
#include "common/stage_messages.h"
#include "server/masks/mask_interpreter.h"
#include "server/session/depth_sentinels.h"
#include "server/session/unlisted_labels.h"

namespace romap::session {

// The first stage: decodes, validates and undistorts the inputs of one session, and decides which masks show objects
// (MaskInterpreter). Checks that frame ids and timestamps
// increase, and keeps a list of the frames for which late masks are still accepted. Not thread-safe.
class Ingest {
 public:
  // Late masks are accepted for frames whose timestamp is at most `max_mask_delay_s` older than the newest one.
  // After a stop was requested, inputs are rejected with CANCELLED.
  Ingest(const CameraModel& camera, double max_mask_delay_s, std::stop_token stop = {});

  // INVALID_ARGUMENT: the frame is malformed or out of order; the message names the field. A rejected frame has no
  // effect on later ones.
  absl::StatusOr<std::shared_ptr<const Frame>> Accept(const FrameInput& input);

  // The input was sent again, and the session accepted it before.
  bool IsDuplicate(const SessionInput& input) const;

  // The masks of an accepted frame that has none. INVALID_ARGUMENT: the masks are malformed, the frame is unknown or
  // too old, or it already has masks. Rejected masks have no effect.
  absl::StatusOr<FrameMasks> AcceptMasks(const MasksInput& input);

  // How the accepted inputs were read, if that is not obvious.
  std::vector<Diagnostic> Diagnostics() const;

 private:
  struct AcceptedFrame {
    uint64_t frame_id = 0;
    int64_t timestamp_ns = 0;
    bool has_masks = false;
  };

  absl::Status CheckOrder(const FrameInput& input) const;
  absl::StatusOr<AcceptedFrame*> FindFrameWithoutMasks(uint64_t frame_id);
  void AddAccepted(const Frame& frame);
  void Undistort(Frame& frame) const;
  void UndistortNearest(cv::Mat& image) const;

  CameraModel camera_;  // of the client's images, with distortion
  // Made for the first valid image, because they are large: 6 bytes per pixel. Empty for a pinhole.
  UndistortionMaps maps_;
  double max_mask_delay_s_;
  const std::stop_token stop_;
  SampleRange range_;  // of the accepted color images
  masks::MaskInterpreter mask_interpreter_;
  DepthSentinels depth_sentinels_;
  UnlistedLabels unlisted_labels_;
  bool any_expired_ = false;
  uint64_t newest_late_masks_ = 0;      // id of their frame; 0: none
  std::deque<AcceptedFrame> accepted_;  // by id and time: the newest and those that may still get masks
};

}  // namespace romap::session
