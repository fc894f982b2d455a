#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/geometry.h"
#include "common/mesh.h"

namespace romap::exports {

struct ColoredPoint {
  Eigen::Vector3d p_world;  // map units
  Rgb8 color = {128, 128, 128};
};

// At most `max_points` vertices of a mesh, evenly chosen, in the World frame. Gray if the mesh has no vertex colors.
std::vector<ColoredPoint> PointsOf(const Mesh& mesh, const Sim3<World, Object>& S_world_mesh, size_t max_points);

}  // namespace romap::exports
