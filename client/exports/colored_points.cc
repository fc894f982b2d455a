#include "client/exports/colored_points.h"

#include <algorithm>

namespace romap::exports {

std::vector<ColoredPoint> PointsOf(const Mesh& mesh, const Sim3<World, Object>& S_world_mesh, size_t max_points) {
  std::vector<ColoredPoint> points;
  const size_t count = std::min(max_points, mesh.vertices.size());
  for (size_t k = 0; k < count; ++k) {
    const size_t vertex = k * mesh.vertices.size() / count;
    ColoredPoint& point = points.emplace_back();
    point.p_world = S_world_mesh * mesh.vertices[vertex].cast<double>();
    if (!mesh.colors.empty()) point.color = mesh.colors[vertex];
  }
  return points;
}

}  // namespace romap::exports
