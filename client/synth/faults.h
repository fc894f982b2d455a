#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "client/synth/frame_plan.h"
#include "client/synth/options.h"
#include "client/synth/random.h"

namespace romap::synth {

// What a detector says about one label of one mask.
struct SynthDetection {
  uint8_t label = 0;   // in this mask
  uint8_t object = 0;  // SceneObject::label it stands for
  double score = 1;    // 0..1
};

// A mask with the faults that were asked for, and what its labels mean, by label. Only labels that have pixels are
// listed.
struct FaultyMask {
  cv::Mat labels;  // CV_8UC1
  std::vector<SynthDetection> detections;
};

// Drops objects, displaces borders and shuffles labels of a true mask (CV_8UC1, labels 1..object_count).
FaultyMask SpoilMask(const cv::Mat& true_labels, int object_count, const SynthOptions& options, Random& random);

// Covers, exposes, blurs and adds noise to CV_8UC3 in place. `motion_px` is how the scene moves through the image at
// this frame; only its direction is used.
void SpoilImage(cv::Mat& color_bgr, const cv::Vec2d& motion_px, const SynthOptions& options, Random& random,
                const FramePlan& plan = {});

}  // namespace romap::synth
