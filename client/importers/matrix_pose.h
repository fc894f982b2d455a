#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/geometry.h"
#include "common/status.h"

namespace romap::importers {

// The rigid transform of a row-major 3x4 or 4x4 matrix. nullopt: it contains inf or NaN, which means "no pose".
// INVALID_ARGUMENT: another number of values, or the rotation is not orthonormal within 1 % or mirrors. `where` names
// the place in messages.
absl::StatusOr<std::optional<SE3<World, Camera>>> PoseOfMatrix(std::span<const double> matrix,
                                                               const std::string& where);

// The numbers of a text file, also inf and nan. INVALID_ARGUMENT names the file and the line. Otherwise as ReadFile.
absl::StatusOr<std::vector<double>> ReadNumbers(const std::string& path);

// The same by lines, without empty lines.
absl::StatusOr<std::vector<std::vector<double>>> ReadNumberLines(const std::string& path);

// The pose in one line of ReadNumberLines(path). nullopt: there is no such line, or no pose in it.
absl::StatusOr<std::optional<SE3<World, Camera>>> PoseOfLine(const std::vector<std::vector<double>>& lines, size_t line,
                                                             const std::string& path);

// Reads a file with one matrix.
absl::StatusOr<std::optional<SE3<World, Camera>>> ReadMatrixPose(const std::string& path);

// Converts the pose of a camera with OpenGL's axes (x right, y up, z backward) to that with x right, y down, z forward.
SE3<World, Camera> FromOpenGl(const SE3<World, Camera>& pose);

// The inverse of a pose that maps world to camera.
SE3<World, Camera> FromWorldToCamera(const SE3<World, Camera>& pose);

}  // namespace romap::importers
