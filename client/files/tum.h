#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/geometry.h"
#include "common/status.h"

namespace romap::files {

// One line of a trajectory in the format of the TUM RGB-D benchmark (Sturm et al., IROS 2012).
struct StampedPose {
  int64_t timestamp_ns = 0;
  SE3<World, Camera> T_world_camera;
};

// Reads `t tx ty tz qx qy qz qw` lines (seconds; camera to world; `#` comments), sorted by time. NOT_FOUND or
// INVALID_ARGUMENT with file and line: not eight finite numbers, quaternion not of length 1 within 5 %, no pose at all.
absl::StatusOr<std::vector<StampedPose>> ReadTum(const std::string& path);

// Writes a trajectory that ReadTum and the usual tools read.
absl::Status WriteTum(const std::string& path, std::span<const StampedPose> poses);

// Pose at a time out of `poses` (sorted): interpolated between its neighbours when they are at most 0.1 s apart,
// otherwise the nearest. nullopt when no pose lies within max_dt_ns.
std::optional<SE3<World, Camera>> PoseAt(std::span<const StampedPose> poses, int64_t timestamp_ns, int64_t max_dt_ns);

}  // namespace romap::files
