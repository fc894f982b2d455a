#pragma once

#include <cstdint>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/eval/points.h"
#include "common/camera_model.h"
#include "common/geometry.h"
#include "common/status.h"

namespace romap::eval {

// Frames of a sequence with true masks, depths and poses, which tell what part of an object some camera saw.
class SeenFrames {
 public:
  // Every n-th frame that has a mask; of those the ones with depth and pose. NOT_FOUND / INVALID_ARGUMENT when the
  // sequence lacks one of these altogether.
  static absl::StatusOr<SeenFrames> Load(const std::string& sequence_dir, int every);

  // Label of the object of that name in the masks; nullopt when objects.yaml has no such name.
  std::optional<int64_t> LabelOf(const std::string& object_name) const;

  // For each point [m, world]: whether some frame has it in the mask of `label` and at most 2 cm behind the true depth.
  std::vector<bool> Seen(const Points& points, int64_t label) const;

 private:
  struct View {
    SE3<Camera, World> T_camera_world;
    cv::Mat labels;  // CV_8UC1 or CV_16UC1
    cv::Mat depth;   // the same, in units of depth_scale_m_
  };

  bool SeenIn(const View& view, const Eigen::Vector3d& p_world, int64_t label) const;

  CameraModel camera_;
  double depth_scale_m_ = 0;
  std::vector<View> views_;
  std::map<std::string, int64_t> labels_;
};

}  // namespace romap::eval
