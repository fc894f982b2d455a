#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace romap::slam {

struct LevelUp {
  Eigen::Vector3d up_world = Eigen::Vector3d::UnitZ();  // unit length
  double sigma_rad = 0;                                 // standard deviation per axis
  double roll_rad = 0;                                  // root mean square roll of the cameras about their optical axes
};

// The up direction from the roll of hand-held cameras. People hold a camera level, within a few degrees, while they
// look at an object from different sides: the x axes of all cameras are about perpendicular to up. A constant roll, of
// a habit or a mount, also tilts the result unless the cameras look in all horizontal directions; the standard
// deviation accounts for it. `x_axes_world`, `up_axes_world`: x and -y of each camera, unit length, in the order of
// time. nullopt: too few directions, or the cameras were not held level (rotating, sideways or mounted at an angle).
std::optional<LevelUp> UpFromLevelCameras(std::span<const Eigen::Vector3d> x_axes_world,
                                          std::span<const Eigen::Vector3d> up_axes_world);

}  // namespace romap::slam
