#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "client/files/time_unit.h"
#include "common/geometry.h"
#include "common/pose_uncertainty.h"
#include "common/status.h"

namespace romap::files {

// One pose of a trajectory in the format of the TUM RGB-D benchmark (Sturm et al., IROS 2012).
struct StampedPose {
  int64_t timestamp_ns = 0;
  SE3<World, Camera> T_world_camera;
  std::optional<PoseUncertainty> uncertainty = {};  // not in the TUM format; see pose_uncertainty_file.h
};

// Reads lines of `t tx ty tz qx qy qz qw` (camera to world; `#` starts a comment). t is in seconds, or in the unit that
// DetectTimeUnit finds, which is stored in `unit` if not null. Returns the poses in order of time. INVALID_ARGUMENT
// names the file and the line: not eight finite numbers, a quaternion whose norm differs from 1 by more than 5 %, or no
// poses. Otherwise as ReadFile.
absl::StatusOr<std::vector<StampedPose>> ReadTum(const std::string& path, TimeUnit* unit = nullptr);

// Writes the format of ReadTum. Errors as WriteFile.
absl::Status WriteTum(const std::string& path, std::span<const StampedPose> poses);

// Interpolation over longer gaps of an unknown motion would be unreliable.
inline constexpr int64_t kMaxInterpolationGap_ns = 100'000'000;

// Returns the pose at a time. `poses` must be sorted by time. Interpolates between the neighboring poses if they are at
// most max_gap_ns apart; otherwise returns the nearest. nullopt if no pose is within max_dt_ns.
std::optional<SE3<World, Camera>> PoseAt(std::span<const StampedPose> poses, int64_t timestamp_ns, int64_t max_dt_ns,
                                         int64_t max_gap_ns = kMaxInterpolationGap_ns);

}  // namespace romap::files
