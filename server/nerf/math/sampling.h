#include "server/nerf/math/lane.h"
#include "server/nerf/math/ray.h"
#include "server/nerf/math/types.h"

#if defined(ROMAP_NERF_MATH_SAMPLING) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_SAMPLING
#else
#define ROMAP_NERF_MATH_SAMPLING
#endif

ROMAP_MATH_BEGIN

// Positions of the samples on a ray. The segment of the ray inside the box is divided into kRayProbes equal pieces; a
// piece, which is at most 1.8 cells long, is occupied if the cell at its center is. Samples are spread evenly over the
// occupied pieces, as if these were joined into one segment. See sample_budget.h for the number of samples.

// A ray in units of cells of the occupancy grid. `extent`: of the box in Unit space.
template <class F>
struct RayInCells {
  F origin[3], direction[3];

  ROMAP_HD RayInCells(const Ray& ray, const float* extent) {
    for (int a = 0; a < 3; ++a) {
      const float cells_per_unit = kOccupancyResolution / extent[a];
      origin[a] = Lane<F>::Set(ray.origin[a] * cells_per_unit);
      direction[a] = Lane<F>::Set(ray.direction[a] * cells_per_unit);
    }
  }
  // The cell at t; points outside the box are clamped to the cells at its border.
  ROMAP_HD typename Lane<F>::Int CellAt(F t) const {
    return CellIndex(MulAdd(direction[0], t, origin[0]), MulAdd(direction[1], t, origin[1]),
                     MulAdd(direction[2], t, origin[2]), kOccupancyResolution);
  }
};

// t at position `pieces` along the segment, in pieces. `piece`: length of a piece; `entry`: t at the start of the
// segment.
template <class F>
ROMAP_HD F PositionOnRay(F pieces, F piece, F entry) {
  return MulAdd(pieces, piece, entry);
}

// t at the center of piece `number`.
template <class F>
ROMAP_HD F PieceCenter(F number, F piece, F entry) {
  return PositionOnRay(number + Lane<F>::Set(0.5f), piece, entry);
}

// Index, 0..last_piece, of the joined occupied piece that contains position `at`.
template <class F>
ROMAP_HD F JoinedPieceAt(F at, F last_piece) {
  return Min(Floor(at), last_piece);
}

// Coordinate of a sample in Unit space, clamped to the box: rounding may move it slightly outside, which the encoding
// does not allow.
template <class F>
ROMAP_HD F SampleCoordinate(F origin, F direction, F t, F extent) {
  return Min(Max(MulAdd(direction, t, origin), Lane<F>::Zero()), extent);
}

ROMAP_MATH_END

#endif
