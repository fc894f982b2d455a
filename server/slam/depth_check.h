#pragma once

#include <deque>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "common/diagnostic.h"
#include "common/stage_messages.h"
#include "server/slam/pose_check.h"

namespace romap::slam {

// Checks depth images against given poses, which must agree with the images: the depth of matched features follows from
// the poses too. Depths that are wrong by a factor are contradicted, and depths along the viewing ray (the distance
// from the camera's center) instead of along the optical axis: they are too large by a share that grows with the
// distance from the image center.
class DepthCheck {
 public:
  // `depth_mu`: of the second frame of the pair; empty if it has none.
  void AddPair(const CameraModel& camera, const PoseCheck::AgreeingPair& pair, const cv::Mat& depth_mu);

  bool IsContradicted() const { return factor_.has_value() || is_along_ray_; }
  // The first frame of the pairs; 1 if all pairs so far are considered.
  uint64_t contradicted_since_frame() const { return first_frame_ids_.front(); }
  std::optional<Diagnostic> Check() const;

 private:
  // Of the depth by the poses over that of the image, at the points of a pair of frames.
  struct Pair {
    double log_ratio = 0;  // median
    // Median absolute deviation of the logarithms, if the depths of the image are along the optical axis or along the
    // ray.
    double axis_spread = 0;
    double ray_spread = 0;
  };
  // Pairs of frames with the logarithms of their ratios, and of the lengths of their rays with z = 1.
  static Pair Summarize(const std::vector<double>& log_ratios, const std::vector<double>& log_lengths);
  std::optional<double> FindFactor() const;
  bool FitsBetterAlongRay() const;

  std::deque<uint64_t> first_frame_ids_ = {1};  // of the pairs
  std::deque<Pair> pairs_;                      // the newest ones
  std::optional<double> factor_;                // that makes the depth images fit
  bool is_along_ray_ = false;
};

// The same frame without its depth image.
std::shared_ptr<const Frame> WithoutDepth(const Frame& frame);

}  // namespace romap::slam
