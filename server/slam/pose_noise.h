#pragma once

#include <deque>
#include <optional>

#include "common/camera_model.h"
#include "common/diagnostic.h"
#include "server/slam/pose_check.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// Measures how well given poses that agree with the images do so: the distance of matched features from their epipolar
// lines, compared with that for the motion which fits the same matches best. Poses that are clearly less exact
// than the images make objects less accurate, and tracking could correct them.
class PoseNoise {
 public:
  explicit PoseNoise(const SlamConfig& config) : config_(config) {}

  void AddPair(const CameraModel& camera, const PoseCheck::AgreeingPair& pair);
  std::optional<Diagnostic> Check() const;

 private:
  // Median distances from the epipolar lines, as a share of the image width.
  struct Residuals {
    double given = 0;
    double best = 0;
  };

  const SlamConfig config_;
  int width_px_ = 0;
  uint64_t pairs_seen_ = 0;
  std::deque<Residuals> pairs_;  // the newest ones
};

}  // namespace romap::slam
