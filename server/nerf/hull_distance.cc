#include "server/nerf/hull_distance.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "server/nerf/math/types.h"

namespace romap::nerf {
namespace {

constexpr int kSide = nerf::kOccupancyResolution;
constexpr int kReach = 10;  // cells

// Squared distance to the nearest cell that is `wanted`, axis by axis (Saito and Toriwaki, 1994), `most` where none is
// within reach.
std::vector<float> SquaredDistances(std::span<const uint8_t> inside, bool wanted, const Eigen::Vector3f& cell,
                                    float most) {
  std::vector<float> squared(inside.size());
  std::ranges::transform(inside, squared.begin(), [&](uint8_t in) { return (in != 0) == wanted ? 0.0f : most; });
  size_t stride = 1;
  for (int axis = 0; axis < 3; ++axis, stride *= kSide) {
    for (size_t first = 0; first < squared.size(); ++first) {
      if (first / stride % kSide != 0) continue;
      std::array<float, kSide> line;
      for (size_t i = 0; i < kSide; ++i) line[i] = squared[first + i * stride];
      for (int i = 0; i < kSide; ++i) {
        float nearest = most;
        for (int j = std::max(0, i - kReach); j <= std::min(kSide - 1, i + kReach); ++j) {
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
  const Eigen::Vector3f cell = extent / kSide;
  const float half_cell = 0.5f * cell.minCoeff(), reach = kReach * cell.minCoeff();
  const std::vector<float> to_inside = SquaredDistances(inside, true, cell, reach * reach);
  const std::vector<float> to_outside = SquaredDistances(inside, false, cell, reach * reach);
  std::vector<float> distance(inside.size());
  for (size_t i = 0; i < distance.size(); ++i) {
    // The border lies half a cell before the nearest cell of the other kind.
    distance[i] = inside[i] != 0 ? half_cell - std::sqrt(to_outside[i]) : std::sqrt(to_inside[i]) - half_cell;
  }
  return distance;
}

}  // namespace romap::nerf
