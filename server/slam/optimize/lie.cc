#include "server/slam/optimize/lie.h"

namespace romap::slam {

Eigen::Matrix3d Hat(const Eigen::Vector3d& a) {
  Eigen::Matrix3d hat;
  hat << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return hat;
}

Eigen::Quaterniond ExpRotation(const Eigen::Vector3d& rotation_rad) {
  const double half_angle_rad = 0.5 * rotation_rad.norm();
  // sin(x) / x is 1 to rounding below 1e-8.
  const double sinc = half_angle_rad < 1e-8 ? 1.0 : std::sin(half_angle_rad) / half_angle_rad;
  Eigen::Quaterniond rotation;
  rotation.w() = std::cos(half_angle_rad);
  rotation.vec() = 0.5 * sinc * rotation_rad;
  return rotation;
}

Eigen::Vector3d LogRotation(const Eigen::Quaterniond& rotation) {
  const Eigen::AngleAxisd angle_axis(rotation);
  return angle_axis.angle() * angle_axis.axis();
}

Eigen::Matrix3d RightJacobianOfRotation(const Eigen::Vector3d& rotation_rad) {
  return IntegratedExponential<3>(-Hat(rotation_rad));
}

Sim3Matrix RightJacobianOfSim3(const Sim3Vector& v) {
  // The Lie bracket with v: [v, d] = generator * d.
  Sim3Matrix generator = Sim3Matrix::Zero();
  const Eigen::Matrix3d rotation = Hat(v.head<3>());
  generator.topLeftCorner<3, 3>() = rotation;
  generator.block<3, 3>(3, 0) = Hat(v.segment<3>(3));
  generator.block<3, 3>(3, 3) = rotation + v[6] * Eigen::Matrix3d::Identity();
  generator.block<3, 1>(3, 6) = -v.segment<3>(3);
  return IntegratedExponential<7>(-generator);
}

}  // namespace romap::slam
