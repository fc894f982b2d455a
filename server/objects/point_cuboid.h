#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "common/cuboid.h"
#include "server/objects/silhouette_hull.h"

namespace romap::objects {

// The paper's box, from an object's map points alone: its sides are the extreme points (equations (1) and (4)), its yaw
// that of the straight edges where given, else of the points' main axis as seen from above. It is what our own fit is
// compared with. `points` in the Grid frame of `region`; nullopt for fewer than three, or when they span no volume.
std::optional<Cuboid> CuboidOfPoints(const HullRegion& region, std::span<const Eigen::Vector3d> points,
                                     std::optional<double> edge_yaw_rad);

}  // namespace romap::objects
