#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>

namespace romap::slam {

// The rotation between two frames as the images show it, in the camera frame, and as the given poses state it, in the
// frame of a body that carries the camera. Both are rotation vectors [rad].
struct RotationPair {
  Eigen::Vector3d camera_rad = Eigen::Vector3d::Zero();
  Eigen::Vector3d body_rad = Eigen::Vector3d::Zero();
};

// The constant rotation of the camera on the body, with body_rad = R_body_camera * camera_rad (the rotation part of
// hand-eye calibration). nullopt: too few pairs, no such rotation fits nearly all of them, their axes are too similar
// to determine it, or it is about the identity.
std::optional<Eigen::Quaterniond> FindBodyRotation(std::span<const RotationPair> pairs);

}  // namespace romap::slam
