#include "client/exports/kitti.h"

#include <fmt/format.h>

#include <iterator>

#include "client/files/text_file.h"

namespace romap::exports {

absl::Status WriteKitti(const std::string& path, std::span<const files::StampedPose> poses) {
  std::string text;
  for (const files::StampedPose& pose : poses) {
    const Eigen::Matrix3d R = pose.T_world_camera.rotation().toRotationMatrix();
    const Eigen::Vector3d& t = pose.T_world_camera.translation();
    for (int row = 0; row < 3; ++row) {
      fmt::format_to(std::back_inserter(text), "{:.9g} {:.9g} {:.9g} {:.9g}{}", R(row, 0), R(row, 1), R(row, 2), t[row],
                     row < 2 ? " " : "\n");
    }
  }
  return files::WriteFile(path, text);
}

}  // namespace romap::exports
