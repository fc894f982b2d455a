#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "server/objects/lines/yaw_from_lines.h"
#include "server/objects/silhouette.h"

namespace romap::objects {

// Yaw of the straight edges on an object's masks, modulo a quarter turn, relative to the x axis of a grid whose z axis
// is up. nullopt when the edges do not determine it, see YawFromLines().
std::optional<YawEstimate> EdgeYaw(std::span<const Silhouette> silhouettes, const Eigen::Matrix3d& R_world_grid);

}  // namespace romap::objects
