#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>

#include "common/stage_messages.h"

namespace romap::slam {

// A small gray copy of a frame for measuring depth with another one, and the frame's sharpness.
struct DepthView {
  CameraModel camera;  // of `gray`
  SE3<World, Camera> T_world_camera;
  cv::Mat gray = {};                           // CV_8UC1, about 160 px wide
  double sharpness = 0;                        // ImageSharpness at half the frame's size
  std::optional<double> sensor_depth_mu = {};  // median of the frame's depth image
};

DepthView MakeDepthView(const Frame& frame, const SE3<World, Camera>& T_world_camera);

// Typical depth of the scene in map units, seen from `first`. If `first` has a depth image, the depth is taken from it.
// Otherwise it is the median over image blocks of a plane sweep (Collins 1996): `second` is warped to `first` for
// planes at several depths and each block votes for the depth with the least difference. nullopt: the views are too
// close together or too different, or have no texture.
std::optional<double> SceneDepth(const DepthView& first, const DepthView& second);

}  // namespace romap::slam
