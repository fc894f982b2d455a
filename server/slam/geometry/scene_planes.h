#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/slam/geometry/plane_fit.h"
#include "server/slam/geometry/support_plane.h"

namespace romap::slam {

// The large planes among the points of a scene, such as walls and the floor, those with the most points first; at most
// three, none of them nearly parallel. A plane counts if it has many points, is thin compared to its extent, and stands
// out from the points on both sides of it (sequential RANSAC, Fischler and Bolles 1981). The normals have no particular
// sign.
std::vector<PlaneFit> FindScenePlanes(std::span<const SupportPoint> points, uint64_t seed);

}  // namespace romap::slam
