#pragma once

#include <span>
#include <string>
#include <vector>

#include "client/files/tum.h"
#include "common/status.h"

namespace romap::files {

// The file with the uncertainties of the poses in the TUM file `trajectory_path`: "run/trajectory.txt" has
// "run/trajectory_uncertainty.txt".
std::string UncertaintyPath(const std::string& trajectory_path);

// Writes lines of `t position_sigma rotation_sigma_rad` (t in seconds as in the TUM file; see PoseUncertainty) for the
// poses that have an uncertainty. Errors as WriteFile.
absl::Status WriteUncertainties(const std::string& path, std::span<const StampedPose> poses);

// Reads the format of WriteUncertainties and sets the uncertainties of the poses with the same timestamps.
// INVALID_ARGUMENT names the file and the line: not three finite numbers, or a sigma that is not positive. Otherwise as
// ReadFile.
absl::Status ReadUncertainties(const std::string& path, std::vector<StampedPose>* poses);

// Writes the TUM file `path` and, beside it, the uncertainties. Without any, removes those of an earlier run. Errors as
// WriteFile.
absl::Status WriteTrajectory(const std::string& path, std::span<const StampedPose> poses);

}  // namespace romap::files
