#pragma once

#include "client/synth/options.h"
#include "common/camera_model.h"

namespace romap::synth {

// The camera of a sequence, with the principal point at the image center and realistic distortion. The focal length is
// 0.9 * width (pinhole), 0.6 * width (radial-tangential) or 0.45 * width (fisheye).
CameraModel SynthCamera(const SynthOptions& options);

}  // namespace romap::synth
