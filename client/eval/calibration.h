#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "common/pose_uncertainty.h"

namespace romap::eval {

// The errors of one aligned pose.
struct PoseError {
  double position_m = 0;
  double rotation_deg = 0;
};

// How well stated uncertainties predict the errors.
struct Calibration {
  size_t poses = 0;  // that have an uncertainty
  // Share of the errors within their 95 % bound, kSigmasTo95 sigmas: 0.95 = well calibrated, less = overconfident, more
  // = too cautious.
  double position_coverage = 0;
  double rotation_coverage = 0;
  // Median bound over median error. 1.8 for normal errors that are alike along all axes, and more if they are not;
  // large bounds say nothing. Infinite without errors.
  double position_bound_ratio = 0;
  double rotation_bound_ratio = 0;
};

// `errors` and `uncertainties` are of the same poses, in the same order; poses without an uncertainty are ignored.
// `scale` converts map units to m. nullopt if no pose has an uncertainty.
std::optional<Calibration> MeasureCalibration(std::span<const PoseError> errors,
                                              std::span<const std::optional<PoseUncertainty>> uncertainties,
                                              double scale);

}  // namespace romap::eval
