#include "server/slam/point_positions.h"

#include <algorithm>

namespace romap::slam {

std::vector<Eigen::Vector3f> PointPositions(const SlamMap& map, size_t max_points) {
  const size_t stride = std::max<size_t>(1, (map.points().size() + max_points - 1) / max_points);
  std::vector<Eigen::Vector3f> positions;
  positions.reserve(map.points().size() / stride + 1);
  size_t index = 0;
  for (const auto& [id, track] : map.points()) {
    if (index++ % stride == 0) positions.push_back(track.point.position_world.cast<float>());
  }
  return positions;
}

}  // namespace romap::slam
