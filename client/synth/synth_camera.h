#pragma once

#include "client/synth/options.h"
#include "common/camera_model.h"

namespace romap::synth {

// The camera of a sequence before SynthOptions::crop, with the principal point at the image center and realistic
// distortion. The default of the focal length is 0.9 * width (pinhole), 0.6 * width (radial-tangential) or 0.45 * width
// (fisheye).
CameraModel UncroppedCamera(const SynthOptions& options);

// The camera of the images of a sequence.
CameraModel SynthCamera(const SynthOptions& options);

}  // namespace romap::synth
