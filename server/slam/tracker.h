#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "common/messages.h"

namespace romap {

// Turns a frame into a frame with a camera pose. Frames come in order of time, from one thread. This is where tracking
// from images alone plugs in.
class Tracker {
 public:
  virtual ~Tracker() = default;
  // A non-OK status concerns this frame only; the next frame may be tracked.
  virtual absl::StatusOr<TrackedFrame> Track(std::shared_ptr<const Frame> frame) = 0;
};

}  // namespace romap
