#include "common/geometry.h"

namespace romap {

// Here and not in the header: it instantiates Eigen's SVD, four seconds in every file that includes it.
Eigen::Quaterniond ShortestRotation(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

Eigen::Quaterniond RotationFromZTo(const Eigen::Vector3d& up_world) {
  return ShortestRotation(Eigen::Vector3d::UnitZ(), up_world);
}

}  // namespace romap
