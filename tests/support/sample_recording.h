#pragma once

// A small recording in memory. foreign_layouts.h writes it in the layouts of other projects.

#include <Eigen/Core>
#include <map>
#include <opencv2/core/mat.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "client/files/sequence.h"
#include "common/camera_model.h"

namespace romap::testing_support {

struct SampleFrame {
  double time_s = 0;
  cv::Mat color = {};     // CV_8UC3
  cv::Mat labels = {};    // CV_16UC1; 0 = no object
  cv::Mat depth_mm = {};  // CV_16UC1; 0 = unknown
  // Camera to world, camera x right, y down, z forward.
  Eigen::Matrix4d T_world_camera = Eigen::Matrix4d::Identity();
};

struct SampleRecording {
  CameraModel camera = {};
  std::vector<SampleFrame> frames = {};
  std::map<int, std::string> classes = {};  // of the labels
};

// `frames` images of 48x36 px at 10 Hz, with two objects, from cameras with different rotations and positions.
SampleRecording MakeSample(int frames = 12);

// The frames of a sequence with depth, masks and poses.
SampleRecording SampleOf(const files::Sequence& sequence);

struct SampleChecks {
  bool camera = true, poses = true, depth = true, masks = true, classes = true;
  bool colors = true;           // exactly; otherwise they may differ slightly, as in a JPEG file
  double depth_error_m = 1e-9;  // at most
  double time_step_s = 0.1;     // between frames; 0: not checked
};

// Expects that a sequence has the camera, times, images, poses, depth, masks and classes of a sample.
void ExpectSample(const files::Sequence& sequence, const SampleRecording& sample, const SampleChecks& checks = {});

void WriteText(const std::string& path, std::string_view text);
// Makes the folder of the file.
void WriteImage(const std::string& path, const cv::Mat& image);

}  // namespace romap::testing_support
