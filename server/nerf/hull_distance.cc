#include "server/nerf/hull_distance.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/nerf/math/types.h"

namespace romap::nerf {
namespace {

constexpr int kHullSide = kOccupancyResolution;
constexpr int kMaxDistance = 10;  // cells

// The squared distance to the nearest cell whose state is `wanted`, axis by axis (Saito and Toriwaki, 1994); `max` if
// there is none within kMaxDistance.
std::vector<float> SquaredDistances(std::span<const uint8_t> inside, bool wanted, const Eigen::Vector3f& cell,
                                    float max) {
  std::vector<float> squared(inside.size());
  std::ranges::transform(inside, squared.begin(), [&](uint8_t in) { return (in != 0) == wanted ? 0.0f : max; });
  size_t stride = 1;
  for (int axis = 0; axis < 3; ++axis, stride *= kHullSide) {
    for (size_t first = 0; first < squared.size(); ++first) {
      if (first / stride % kHullSide != 0) continue;
      std::array<float, kHullSide> line;
      for (size_t i = 0; i < kHullSide; ++i) line[i] = squared[first + i * stride];
      for (int i = 0; i < kHullSide; ++i) {
        float nearest = max;
        for (int j = std::max(0, i - kMaxDistance); j <= std::min(kHullSide - 1, i + kMaxDistance); ++j) {
          const float along = cell[axis] * static_cast<float>(i - j);
          nearest = std::min(nearest, line[static_cast<size_t>(j)] + along * along);
        }
        squared[first + static_cast<size_t>(i) * stride] = nearest;
      }
    }
  }
  return squared;
}

}  // namespace

std::vector<float> DistanceToBorder(std::span<const uint8_t> inside, const Eigen::Vector3f& extent) {
  const Eigen::Vector3f cell = extent / kHullSide;
  const float half_cell = 0.5f * cell.minCoeff(), max = kMaxDistance * cell.minCoeff();
  const std::vector<float> to_inside = SquaredDistances(inside, true, cell, max * max);
  const std::vector<float> to_outside = SquaredDistances(inside, false, cell, max * max);
  std::vector<float> distance(inside.size());
  for (size_t i = 0; i < distance.size(); ++i) {
    // The border lies half a cell before the center of the nearest cell of the other state.
    distance[i] = inside[i] != 0 ? half_cell - std::sqrt(to_outside[i]) : std::sqrt(to_inside[i]) - half_cell;
  }
  return distance;
}

}  // namespace romap::nerf
