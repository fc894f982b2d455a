#include "common/geometry.h"

namespace romap {

// Not in the header, because it instantiates Eigen's SVD, which takes four seconds to compile.
Eigen::Quaterniond ShortestRotation(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

Eigen::Quaterniond RotationFromZTo(const Eigen::Vector3d& up_world) {
  return ShortestRotation(Eigen::Vector3d::UnitZ(), up_world);
}

}  // namespace romap
