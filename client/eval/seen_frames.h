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

// The frames of a sequence with true masks, depth and poses. Determines which part of an object was visible.
class SeenFrames {
 public:
  // Loads every n-th frame with a mask, if it also has depth and a pose. FAILED_PRECONDITION if there is no such frame
  // or no objects.yaml. Otherwise as Sequence::Open and Load.
  static absl::StatusOr<SeenFrames> Load(const std::string& sequence_dir, int every);

  // The mask label of the object with this name; nullopt if objects.yaml has no such object.
  std::optional<int64_t> LabelOf(const std::string& object_name) const;

  // For each point [World, m]: whether in some frame it is in the mask of `label` and at most 2 cm behind the true
  // depth.
  std::vector<bool> Seen(const Points& points, int64_t label) const;

 private:
  struct View {
    SE3<Camera, World> T_camera_world;
    cv::Mat labels;  // CV_8UC1 or CV_16UC1
    cv::Mat depth;   // CV_8UC1 or CV_16UC1, in units of depth_scale_m_
  };

  bool SeenIn(const View& view, const Eigen::Vector3d& p_world, int64_t label) const;

  CameraModel camera_;
  double depth_scale_m_ = 0;
  std::vector<View> views_;
  std::map<std::string, int64_t> labels_;
};

}  // namespace romap::eval
