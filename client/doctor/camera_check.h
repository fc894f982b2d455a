#pragma once

#include <vector>

#include "common/camera_model.h"
#include "common/diagnostic.h"

namespace romap::doctor {

// Whether a calibration is plausible: field of view, ratio of the focal lengths, position of the principal point,
// distortion at the corners of the image. Codes: calibration_implausible.
std::vector<Diagnostic> CheckCamera(const CameraModel& camera);

}  // namespace romap::doctor
