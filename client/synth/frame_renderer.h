#pragma once

#include <opencv2/core/mat.hpp>

#include "client/synth/scene.h"
#include "common/camera_model.h"
#include "common/geometry.h"

namespace romap::synth {

// A frame as it truly is, images of the camera's size.
struct TrueFrame {
  cv::Mat color_bgr;  // CV_8UC3 sRGB, averaged over 2x2 samples a pixel in linear light
  cv::Mat labels;     // CV_8UC1 label of the object at the pixel's centre, 0 = room
  cv::Mat depth_m;    // CV_32FC1 z depth at the pixel's centre, metres; 0 = nothing
};

// Draws a scene whose light is baked. Safe to call from several threads.
TrueFrame RenderFrame(const Scene& scene, const CameraModel& camera, const SE3<World, Camera>& T_world_camera);

}  // namespace romap::synth
