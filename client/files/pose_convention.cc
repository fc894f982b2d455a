#include "client/files/pose_convention.h"

#include <array>
#include <cmath>
#include <sstream>

#include "client/files/text_file.h"

namespace romap::files {

absl::Status ParseConvention(const std::string& names, PoseConvention* convention) {
  std::istringstream stream(names);
  for (std::string name; std::getline(stream, name, ',');) {
    if (name == "opengl") {
      convention->opengl = true;
    } else if (name == "world_to_camera") {
      convention->world_to_camera = true;
    } else if (name == "wxyz") {
      convention->wxyz = true;
    } else if (name != "opencv") {
      return InvalidArgument("pose convention '{}' is unknown; expected opencv, opengl, world_to_camera or wxyz", name);
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<SE3<Camera, Camera>> ParsePoseOffset(const std::string& text) {
  std::istringstream stream(text);
  std::array<double, 7> x{};
  size_t count = 0;
  for (std::string field; stream >> field; ++count) {
    const std::optional<double> value = ParseNumber(field);
    if (!value) return InvalidArgument("pose offset: '{}' is not a finite number", field);
    if (count < x.size()) x[count] = *value;
  }
  if (count != x.size()) {
    return InvalidArgument("pose offset: has {} numbers; expected 7 (tx ty tz qx qy qz qw)", count);
  }
  const Eigen::Quaterniond rotation(x[6], x[3], x[4], x[5]);
  if (std::abs(rotation.norm() - 1) > 0.05) {
    return InvalidArgument("pose offset: quaternion norm is {:.3f}; expected 1", rotation.norm());
  }
  return SE3<Camera, Camera>(rotation, Eigen::Vector3d(x[0], x[1], x[2]));
}

SE3<World, Camera> ApplyConvention(const PoseConvention& convention, const SE3<World, Camera>& pose) {
  SE3<World, Camera> converted = pose;
  if (convention.wxyz) {
    const Eigen::Quaterniond& q = pose.rotation();
    converted = {Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w()), pose.translation()};
  }
  if (convention.world_to_camera) {
    const SE3<Camera, World> inverse = converted.Inverse();
    converted = {inverse.rotation(), inverse.translation()};
  }
  if (convention.offset) converted = converted * *convention.offset;
  if (convention.opengl) {
    const Eigen::Quaterniond half_turn_about_x(0, 1, 0, 0);
    converted = {converted.rotation() * half_turn_about_x, converted.translation()};
  }
  return converted;
}

}  // namespace romap::files
