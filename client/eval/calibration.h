#pragma once

#include <optional>
#include <span>

namespace romap::eval {

// Standard deviations of one estimated pose, per axis.
struct PoseSigma {
  double position = 0;  // in the unit of the estimated trajectory
  double rotation_deg = 0;
};

// The errors of one aligned pose.
struct PoseError {
  double position_m = 0;
  double rotation_deg = 0;
};

// Share of the errors within the 95 % bound of their predicted distribution: 0.95 = well calibrated, less =
// overconfident, more = too cautious.
struct Calibration {
  double position_coverage = 0;
  double rotation_coverage = 0;
};

// `errors` and `sigmas` have the same length; `scale` converts position sigmas to m. nullopt if there are none.
std::optional<Calibration> MeasureCalibration(std::span<const PoseError> errors, std::span<const PoseSigma> sigmas,
                                              double scale);

}  // namespace romap::eval
