#include "server/nerf/math/lane.h"

#if defined(ROMAP_NERF_MATH_RAY) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_RAY
#else
#define ROMAP_NERF_MATH_RAY
#endif

ROMAP_MATH_BEGIN

// Intersects a ray with the box [0, extent] by the slab method (Kay and Kajiya, 1986). `origin`, `direction`, `extent`:
// 3 values each. Returns false if the ray misses the box or the box lies behind the origin; otherwise entry >= 0 and
// exit > entry, in units of `direction`.
template <class F>
ROMAP_HD bool IntersectBox(const F* origin, const F* direction, const F* extent, F& entry, F& exit) {
  entry = 0;
  exit = static_cast<F>(1e30);
  for (int a = 0; a < 3; ++a) {
    const F inverse = 1 / direction[a];  // may be infinite; the comparisons below handle that
    F near = -origin[a] * inverse;
    F far = (extent[a] - origin[a]) * inverse;
    if (near > far) {
      const F swap = near;
      near = far;
      far = swap;
    }
    // A NaN (origin on a slab plane and direction parallel to it) leaves the bound unchanged.
    if (near > entry) entry = near;
    if (far < exit) exit = far;
    if (direction[a] == 0 && (origin[a] < 0 || origin[a] > extent[a])) return false;
  }
  return exit > entry;
}

// Index of the cell that contains a point in a grid of `resolution`^3 cells (at most 128^3), x fastest. The point is in
// units of cells and is clamped to the grid.
template <class F>
ROMAP_HD typename Lane<F>::Int CellIndex(F x_cells, F y_cells, F z_cells, int resolution) {
  const F zero = Lane<F>::Zero(), last = Lane<F>::Set(static_cast<float>(resolution - 1));
  const F x = Floor(Min(Max(x_cells, zero), last));
  const F y = Floor(Min(Max(y_cells, zero), last));
  const F z = Floor(Min(Max(z_cells, zero), last));
  const F r = Lane<F>::Set(static_cast<float>(resolution));
  return Lane<F>::WholeToInt(MulAdd(MulAdd(z, r, y), r, x));  // exact: all values are small integers
}

ROMAP_MATH_END

#endif
