#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "common/diagnostic.h"
#include "common/stage_messages.h"
#include "server/slam/depth_check.h"
#include "server/slam/distortion_check.h"
#include "server/slam/focal_check.h"
#include "server/slam/frame_features.h"
#include "server/slam/pose_check.h"
#include "server/slam/pose_noise.h"
#include "server/slam/slam_config.h"

namespace romap::slam {

// Everything that is checked of given poses, of the calibration and of the depth of their frames, against the images.
class GivenPoseChecks {
 public:
  // Why frames with a given pose are not used.
  struct Contradiction {
    const char* reason = "";
    uint64_t since_frame = 0;  // the first frame that it concerns
  };

  explicit GivenPoseChecks(const SlamConfig& config) : poses_(config), noise_(config) {}

  // Call for each keyframe with a given pose. `frame`: as received, `features`: converted by its shutter. `depth_mu`:
  // of the frame, even if it is not used; may be empty.
  void AddFrame(const Frame& frame, const std::shared_ptr<const FrameFeatures>& features,
                const SE3<World, Camera>& T_world_camera, const cv::Mat& depth_mu);

  std::optional<Contradiction> PosesOrCamera() const;
  bool IsDepthContradicted() const { return depth_.IsContradicted(); }
  uint64_t depth_contradicted_since_frame() const { return depth_.contradicted_since_frame(); }
  std::vector<Diagnostic> Diagnostics() const;

 private:
  PoseCheck poses_;
  PoseNoise noise_;
  FocalCheck focal_;
  DistortionCheck distortion_;
  DepthCheck depth_;
};

}  // namespace romap::slam
