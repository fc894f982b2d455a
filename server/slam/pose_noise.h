#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "common/camera_model.h"
#include "common/diagnostic.h"
#include "server/slam/pose_check.h"
#include "server/slam/pose_hypothesis.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// Measures how well given poses that agree with the images do so: the distance of matched features from their epipolar
// lines, compared with that for the motion which fits the same matches best. Poses that are clearly less exact
// than the images make objects less accurate, and tracking could correct them. Flipped images may look like inexact
// poses: where the depth of the scene hardly varies, each motion is nearly that of a scene with near and far exchanged.
class PoseNoise {
 public:
  explicit PoseNoise(const SlamConfig& config) : config_(config) {}

  void AddPair(const CameraModel& camera, const PoseCheck::AgreeingPair& pair);
  // The poses fit the images exactly when these are read as mirrored or turned.
  bool ImagesAreFlipped() const { return FindFlip().has_value(); }
  std::optional<Diagnostic> Check() const;

 private:
  // Median distances from the epipolar lines, as a share of the image width.
  struct Residuals {
    double given = 0;
    double best = 0;
    std::vector<double> flipped = {};  // by FlipHypotheses(); empty: the given poses are exact
  };

  static const std::vector<PoseHypothesis>& FlipHypotheses();
  double MedianOf(double Residuals::*distance) const;
  bool IsInexact() const;
  std::optional<PoseHypothesis> FindFlip() const;

  const SlamConfig config_;
  int width_px_ = 0;
  uint64_t pairs_seen_ = 0;
  std::deque<Residuals> pairs_;  // the newest ones
};

}  // namespace romap::slam
