#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "common/cuboid.h"
#include "server/objects/silhouette_hull.h"

namespace romap::objects {

// The cuboid of the paper, from an object's map points alone: the extreme points bound it (equations (1) and (4)), and
// its yaw is that of the straight edges if given, otherwise that of the main axis of the points as seen from above.
// Used as a baseline for FitCuboid(). `points`: in the Grid frame of `region`; nullopt for fewer than three, or when
// they span no volume.
std::optional<Cuboid> CuboidOfPoints(const HullRegion& region, std::span<const Eigen::Vector3d> points,
                                     std::optional<double> edge_yaw_rad);

}  // namespace romap::objects
