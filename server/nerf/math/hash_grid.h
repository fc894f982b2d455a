#include "server/nerf/math/lane.h"

#if defined(ROMAP_NERF_MATH_HASH_GRID) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_MATH_HASH_GRID
#else
#define ROMAP_NERF_MATH_HASH_GRID
#endif

ROMAP_MATH_BEGIN

// Multi-resolution hash encoding (Mueller et al., 2022; paper section on the NeRF model), two features per entry.
//
// The index of corner (x, y, z) is (x + y stride_y + z stride_z) & mask: a dense array for levels that fit into the
// table, a lattice hash for finer levels. In both cases x and x + 1 are adjacent, so the eight corners of a cell are
// four pairs of entries, and each pair is one load of four floats. Every level has one entry more than its mask spans,
// for the pair at its end. The grid is unbounded: a dense level repeats beyond its array, so that no two corners of any
// window of stride_y^3 corners share an entry, independent of the position of the window.

// The four pairs of a cell and their weights on one level (or one level per lane).
template <class F>
struct GridCell {
  typename Lane<F>::Int pair[4];  // entry of the corner with the lower x: (y, z), (y+1, z), (y, z+1), (y+1, z+1)
  F weight[4];                    // bilinear in y, z
  F along_x;                      // 0..1 within the pair
};

// Finds the cell of a point of Unit space on a level with `scale` cells per unit. The offset by one half shifts the
// lattices of the levels relative to each other.
template <class F>
ROMAP_HD GridCell<F> LocateCell(F x_unit, F y_unit, F z_unit, F scale, typename Lane<F>::Int stride_y,
                                typename Lane<F>::Int stride_z, typename Lane<F>::Int mask,
                                typename Lane<F>::Int offset) {
  const F half = Lane<F>::Set(0.5f), one = Lane<F>::Set(1.0f);
  const F px = MulAdd(x_unit, scale, half), py = MulAdd(y_unit, scale, half), pz = MulAdd(z_unit, scale, half);
  const F x0 = Floor(px), y0 = Floor(py), z0 = Floor(pz);
  const auto ix = Lane<F>::WholeToInt(x0), iy = Lane<F>::WholeToInt(y0), iz = Lane<F>::WholeToInt(z0);
  const F fy = py - y0, fz = pz - z0;
  const F gy = one - fy, gz = one - fz;
  const auto base = ix + iy * stride_y + iz * stride_z;
  const auto above = base + stride_z;
  GridCell<F> cell;
  cell.pair[0] = (base & mask) + offset;
  cell.pair[1] = ((base + stride_y) & mask) + offset;
  cell.pair[2] = (above & mask) + offset;
  cell.pair[3] = ((above + stride_y) & mask) + offset;
  cell.weight[0] = gy * gz;
  cell.weight[1] = fy * gz;
  cell.weight[2] = gy * fz;
  cell.weight[3] = fy * fz;
  cell.along_x = px - x0;
  return cell;
}

// Transforms a point from the Unit space of the training box to that of the grid, in place.
template <class F>
ROMAP_HD void MoveToGrid(const GridPose& pose, F& x, F& y, F& z) {
  const auto row = [&](int r) {
    F sum = Lane<F>::Set(pose.shift[r]);
    sum = MulAdd(Lane<F>::Set(pose.rotation[r][0]), x, sum);
    sum = MulAdd(Lane<F>::Set(pose.rotation[r][1]), y, sum);
    return MulAdd(Lane<F>::Set(pose.rotation[r][2]), z, sum);
  };
  const F gx = row(0), gy = row(1), gz = row(2);
  x = gx;
  y = gy;
  z = gz;
}

// Trilinear interpolation on one level: feature[0..1]. `pair` and `weight` belong to one lane, with stride `step`.
template <class Q>
ROMAP_HD void InterpolateCell(const float* table, const uint32_t* pair, const float* weight, float along_x, int step,
                              float* feature) {
  Q sum = Q::Load(table + 2 * static_cast<uint64_t>(pair[0])).Times(weight[0]);
  for (int c = 1; c < 4; ++c) {
    sum = sum.Plus(Q::Load(table + 2 * static_cast<uint64_t>(pair[c * step])), weight[c * step]);
  }
  sum.StoreBlend(along_x, feature);
}

// Adjoint of InterpolateCell: adds d_feature[0..1] times the weight of each corner to the gradient table.
template <class Q>
ROMAP_HD void ScatterCell(float* gradient, const uint32_t* pair, const float* weight, float along_x, int step,
                          const float* d_feature) {
  const Q d = Q::Twice(d_feature).Times(Q::Halves(1.0f - along_x, along_x));
  for (int c = 0; c < 4; ++c) {
    float* entry = gradient + 2 * static_cast<uint64_t>(pair[c * step]);
    Q::Load(entry).Plus(d, weight[c * step]).Store(entry);
  }
}

ROMAP_MATH_END

#endif
