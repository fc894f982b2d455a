#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "client/synth/frame_renderer.h"
#include "client/synth/options.h"
#include "common/camera_model.h"

namespace romap::synth {

// Objects directly in front of the camera: SynthOptions::gripper_share and occluder_share. They have no label, and the
// scene behind them is hidden in color, labels and depth.
class Overlays {
 public:
  Overlays(const SynthOptions& options, const CameraModel& camera);

  // Draws the objects into frame number `frame`, from 0. Thread-safe.
  void Apply(int frame, TrueFrame& image) const;

 private:
  // One crossing of the occluder: it moves along a line through a point near the image center.
  struct Crossing {
    cv::Point2d middle_px;
    cv::Point2d direction;  // unit length
  };

  void DrawOccluder(int frame, TrueFrame& image) const;

  double occluder_radius_px_ = 0;  // 0 = none
  double frames_per_crossing_ = 1;
  double half_length_px_ = 0;  // from the middle to the end of a crossing
  std::vector<Crossing> crossings_;
  std::vector<double> outline_;  // radius of the occluder at equally spaced angles, mean 1
  cv::Mat occluder_bgr_;         // texture, centered on the occluder
  cv::Mat gripper_;              // CV_8UC1, 255 = gripper; empty = none
  cv::Mat gripper_bgr_;
};

}  // namespace romap::synth
