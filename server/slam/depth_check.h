#pragma once

#include <deque>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "common/diagnostic.h"
#include "common/stage_messages.h"
#include "server/slam/pose_check.h"

namespace romap::slam {

// Checks the scale of depth images against given poses: the depth of matched features follows from the poses too. The
// poses must agree with the images.
class DepthCheck {
 public:
  // `depth_mu`: of the second frame of the pair; empty if it has none.
  void AddPair(const CameraModel& camera, const PoseCheck::AgreeingPair& pair, const cv::Mat& depth_mu);

  bool IsContradicted() const { return factor_.has_value(); }
  // The first frame of the pairs; 1 if all pairs so far are considered.
  uint64_t contradicted_since_frame() const { return first_frame_ids_.front(); }
  std::optional<Diagnostic> Check() const;

 private:
  void Decide();

  std::deque<uint64_t> first_frame_ids_ = {1};  // of the pairs
  std::deque<double> log_ratios_;  // per pair: of the depth by the poses over that of the image; the newest ones
  std::optional<double> factor_;   // that makes the depth images fit
};

// The same frame without its depth image.
std::shared_ptr<const Frame> WithoutDepth(const Frame& frame);

}  // namespace romap::slam
