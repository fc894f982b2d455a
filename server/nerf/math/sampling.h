#pragma once

// Where a ray is sampled, point by point: the form for back ends that give each probe and each sample a thread of its
// own. The ray's way through the box is cut into kRayProbes equal pieces; a piece is occupied when the cell in its
// middle is; samples spread evenly over the occupied pieces, as if these were one stretch.

#include <cstdint>

#include "server/nerf/math/ray.h"
#include "server/nerf/math/types.h"

namespace romap::nerf {

// How many samples a ray gets.
struct SampleBudget {
  float finest_step = 0.01f;  // box sides; samples are not set closer than this, down to `least`
  int least = 4;
  int most = 16;
  bool skip_empty = true;  // false: `most` samples between entry and exit of the box, occupied or not
};

ROMAP_HD int CountBits(uint64_t bits) {
#ifdef __CUDA_ARCH__
  return __popcll(bits);
#else
  return __builtin_popcountll(bits);
#endif
}

// Place of the set bit before which `n` others are set; there must be more than n.
ROMAP_HD int PlaceOfBit(uint64_t bits, int n) {
  int place = 0;
  for (int width = 32; width > 0; width /= 2) {
    const uint64_t low = bits & ((uint64_t{1} << width) - 1);
    const int in_low = CountBits(low);
    if (n < in_low) {
      bits = low;
    } else {
      n -= in_low;
      bits >>= width;
      place += width;
    }
  }
  return place;
}

// Point of a ray at t, in the Unit space of the box.
ROMAP_HD float RayPoint(const Ray& ray, int axis, float t) {
  return plain::MulAdd(ray.direction[axis], t, ray.origin[axis]);
}

// The cell of the occupancy grid at t; points outside [0, extent] count as those at its border.
ROMAP_HD uint32_t CellOnRay(const Ray& ray, const float* extent, float t) {
  float at_cell[3];
  for (int a = 0; a < 3; ++a) {
    const float cells_per_unit = kOccupancyResolution / extent[a];
    at_cell[a] = plain::MulAdd(ray.direction[a] * cells_per_unit, t, ray.origin[a] * cells_per_unit);
  }
  return plain::CellIndex(at_cell[0], at_cell[1], at_cell[2], kOccupancyResolution);
}

// Middle of piece `i`, `piece` long, of a way that begins at `entry`.
ROMAP_HD float ProbePlace(int i, float piece, float entry) {
  return plain::MulAdd(static_cast<float>(i) + 0.5f, piece, entry);
}

// Samples for a ray whose occupied pieces are `stretch` long together.
ROMAP_HD int SampleCount(const SampleBudget& budget, float stretch) {
  if (!(stretch > 1e-6f)) return 0;
  if (!budget.skip_empty) return budget.most;
  const int wanted = static_cast<int>(stretch / budget.finest_step) + 1;
  return wanted < budget.least ? budget.least : wanted > budget.most ? budget.most : wanted;
}

// t of sample `i` of `count`; bit k of `occupied`: piece k is. `jitter` in 0..1 places a sample in its stratum.
ROMAP_HD float SamplePlace(int i, int count, float jitter, uint64_t occupied, float piece, float entry) {
  const int pieces = CountBits(occupied);
  const float at = (static_cast<float>(i) + jitter) * (static_cast<float>(pieces) / static_cast<float>(count));
  const int passed = static_cast<int>(at) < pieces ? static_cast<int>(at) : pieces - 1;
  const float place = static_cast<float>(PlaceOfBit(occupied, passed)) + (at - static_cast<float>(passed));
  return plain::MulAdd(place, piece, entry);
}

}  // namespace romap::nerf
