#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "server/objects/lines/yaw_from_lines.h"
#include "server/objects/silhouette.h"

namespace romap::objects {

// Yaw of the straight edges on an object's masks, modulo a quarter turn, from the x axis of a grid whose z is up; see
// YawFromLines(). nullopt when they tell nothing.
std::optional<YawEstimate> EdgeYaw(std::span<const Silhouette> silhouettes, const Eigen::Matrix3d& R_world_grid);

}  // namespace romap::objects
