#include "common/geometry.h"

namespace romap {

// Here and not in the header: it instantiates Eigen's SVD, four seconds in every file that includes it.
Eigen::Quaterniond RotationFromZTo(const Eigen::Vector3d& up_world) {
  return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), up_world);
}

}  // namespace romap
