#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "client/synth/frame_plan.h"
#include "client/synth/options.h"
#include "client/synth/random.h"

namespace romap::synth {

// The detection of one label of a mask.
struct SynthDetection {
  uint8_t label = 0;   // in this mask
  uint8_t object = 0;  // SceneObject::label of its object
  double score = 1;    // 0..1
};

// A mask with faults, and the detections of all labels that have pixels, in ascending order of label.
struct FaultyMask {
  cv::Mat labels;  // CV_8UC1
  std::vector<SynthDetection> detections;
};

// Applies the mask faults of `options` to a true mask (CV_8UC1, labels 1..object_count).
FaultyMask DegradeMask(const cv::Mat& true_labels, int object_count, const SynthOptions& options, Random& random);

// Applies the image faults of `options` and `plan` to a CV_8UC3 image in place. Motion blur has the direction of
// `motion_px`, the motion of the image content.
void DegradeImage(cv::Mat& color_bgr, const cv::Vec2d& motion_px, const SynthOptions& options, Random& random,
                  const FramePlan& plan = {});

// Adds the depth noise of `options` to a CV_32FC1 image of depths [m] in place. Pixels without depth keep the value 0.
void DegradeDepth(cv::Mat& depth_m, const SynthOptions& options, Random& random);

}  // namespace romap::synth
