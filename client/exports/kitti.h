#pragma once

#include <span>
#include <string>

#include "client/files/tum.h"
#include "common/status.h"

namespace romap::exports {

// Writes a trajectory as the KITTI odometry benchmark does: per frame one line with the 3 x 4 matrix of the pose,
// camera to world, row by row. The format has no times. Errors as WriteFile.
absl::Status WriteKitti(const std::string& path, std::span<const files::StampedPose> poses);

}  // namespace romap::exports
