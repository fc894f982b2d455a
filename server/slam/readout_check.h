#pragma once

#include <optional>

#include "common/stage_messages.h"
#include "server/slam/local_map_tracking.h"
#include "server/slam/readout_estimator.h"

namespace romap::slam {

// Checks the readout time that the camera states against the tracked frames.
class ReadoutCheck {
 public:
  // `rolling`: the features of the frame at their pixels in the image. `motion`: of the camera per second, see
  // ReadoutEstimator.
  void AddFrame(const Frame& frame, const FrameFeatures& rolling, const PoseFromPoints& pose,
                const LocalMapTracking& tracking, const ReadoutMotion& motion);
  // The images contradict the stated time.
  std::optional<Diagnostic> Check(double stated_s) const;

 private:
  ReadoutEstimator estimator_;
};

}  // namespace romap::slam
