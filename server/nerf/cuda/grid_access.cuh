#pragma once

// Access to the hash grid, one point and one level at a time.

#include "server/nerf/cuda/cuda_launch.h"
#include "server/nerf/math/hash_grid.h"

namespace romap::nerf::cuda {

// A Quad that is loaded in two parts, because entries are aligned to 8 bytes only.
struct PairQuad : plain::Quad {
  __device__ PairQuad(const plain::Quad& quad) : plain::Quad(quad) {}
  static __device__ PairQuad Load(const float* p) {
    const float2 low = *reinterpret_cast<const float2*>(p), high = *reinterpret_cast<const float2*>(p + 2);
    return plain::Quad{{low.x, low.y, high.x, high.y}};
  }
  __device__ PairQuad Times(float s) const { return plain::Quad::Times(s); }
  __device__ PairQuad Plus(const plain::Quad& other, float s) const { return plain::Quad::Plus(other, s); }
};

// Replaces Quad where many threads add to one table: loading returns zeros, storing adds atomically.
struct AtomicQuad : plain::Quad {
  __device__ AtomicQuad(const plain::Quad& quad) : plain::Quad(quad) {}
  static __device__ AtomicQuad Load(const float*) { return plain::Quad{{0.0f, 0.0f, 0.0f, 0.0f}}; }
  __device__ AtomicQuad Plus(const plain::Quad& other, float s) const { return plain::Quad::Plus(other, s); }
  __device__ void Store(float* p) const {
    for (int i = 0; i < 4; ++i) atomicAdd(p + i, v[i]);
  }
};

__device__ inline plain::GridCell<float> CellOf(const GridLayout& grid, int level, float x, float y, float z) {
  return plain::LocateCell(x, y, z, grid.scale[level], grid.stride_y[level], grid.stride_z[level], grid.mask[level],
                           grid.offset[level]);
}

// feature[kFeaturesPerLevel] of one level.
__device__ inline void EncodeLevel(const GridLayout& grid, const float* table, int level, float x, float y, float z,
                                   float* feature) {
  const plain::GridCell<float> cell = CellOf(grid, level, x, y, z);
  plain::InterpolateCell<PairQuad>(table, cell.pair, cell.weight, cell.along_x, 1, feature);
}

__device__ inline void ScatterLevel(const GridLayout& grid, float* gradient, int level, float x, float y, float z,
                                    const float* d_feature) {
  const plain::GridCell<float> cell = CellOf(grid, level, x, y, z);
  plain::ScatterCell<AtomicQuad>(gradient, cell.pair, cell.weight, cell.along_x, 1, d_feature);
}

}  // namespace romap::nerf::cuda
