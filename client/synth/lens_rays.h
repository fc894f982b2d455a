#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/camera_model.h"

namespace romap::synth {

// The x and y of the direction with z = 1 from which light reaches each sample of an image: samples_across x
// samples_across evenly spread inside each pixel, row-major over the finer image (see Supersampled()). Exact to 1e-6 px
// by the lens's formula; NaN where no ray from the front meets the sample.
std::vector<Eigen::Vector2d> LensRays(const CameraModel& camera, int samples_across);

}  // namespace romap::synth
