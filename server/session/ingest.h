#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>

#include "common/lens.h"
#include "common/messages.h"

namespace romap {

// First step of a frame's life: decodes, validates and undistorts. Remembers the last accepted id and time, so that
// frames cannot go back. One per session, used by its tracking thread only.
class Ingest {
 public:
  explicit Ingest(const CameraModel& camera);

  // INVALID_ARGUMENT naming what is wrong with the frame; then the frame counts as never sent.
  absl::StatusOr<std::shared_ptr<const Frame>> Accept(const FrameInput& input);

 private:
  absl::Status CheckOrder(const FrameInput& input) const;
  void Undistort(Frame& frame) const;

  CameraModel camera_;     // as the client gave it
  UndistortionMaps maps_;  // empty for a pinhole
  bool any_accepted_ = false;
  uint64_t last_frame_id_ = 0;
  int64_t last_timestamp_ns_ = 0;
};

}  // namespace romap
