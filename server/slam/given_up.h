#pragma once

#include <Eigen/Core>
#include <optional>

#include "common/diagnostic.h"
#include "server/slam/world_up.h"

namespace romap::slam {

// Compares up as the images show it with the direction that is taken as up in the world of given poses. Worlds whose y
// is up, or whose axes are those of the first camera, give tilted cuboids. A diagnostic only if the evidence is clear
// and the surface under the objects confirms it: a camera that looks down has no up of its own.
std::optional<Diagnostic> CheckGivenUp(const WorldUp& up_of_images, const Eigen::Vector3d& given_up_world);

}  // namespace romap::slam
