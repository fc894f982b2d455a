#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/camera_model.h"

namespace romap::synth {

// The ray of each sample of an image as x and y of its direction with z = 1. Each pixel has samples_across x
// samples_across samples; row-major over the supersampled image (see Supersampled()). Accurate to 1e-6 px; NaN for
// samples that no ray from the front reaches.
std::vector<Eigen::Vector2d> LensRays(const CameraModel& camera, int samples_across);

}  // namespace romap::synth
