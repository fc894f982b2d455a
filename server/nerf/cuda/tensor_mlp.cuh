#pragma once

// The MLP of a tile on tensor cores: products of 16 x 16 matrices with factors in half precision and sums in single
// precision. A warp owns the rows of its own samples, and some of the weight gradients.

#include "server/nerf/cuda/grid_access.cuh"
#include "server/nerf/cuda/tile.cuh"

namespace romap::nerf::cuda {

struct TensorMlp {
  using Factor = __half;
  using Sum = nvcuda::wmma::fragment<nvcuda::wmma::accumulator, kEdge, kEdge, kEdge, float>;
  using RowMajor = nvcuda::wmma::row_major;
  using ColMajor = nvcuda::wmma::col_major;

  static constexpr int kRowsOfWarp = kWarpThreads;

  // sum += a b over `k_tiles` tiles along k. a_row, b_row: stride of rows; a_step, b_step: stride of tiles along k.
  template <class LayoutA, class LayoutB>
  __device__ static void Multiply(const __half* a, int a_row, int a_step, const __half* b, int b_row, int b_step,
                                  int k_tiles, Sum& sum) {
    using namespace nvcuda;
    wmma::fragment<wmma::matrix_a, kEdge, kEdge, kEdge, __half, LayoutA> a_tile;
    wmma::fragment<wmma::matrix_b, kEdge, kEdge, kEdge, __half, LayoutB> b_tile;
    for (int k = 0; k < k_tiles; ++k) {
      wmma::load_matrix_sync(a_tile, a + k * a_step, a_row);
      wmma::load_matrix_sync(b_tile, b + k * b_step, b_row);
      wmma::mma_sync(sum, a_tile, b_tile, sum);
    }
  }

  // Stores a Sum to the staging area of the warp, because the assignment of its elements to lanes is not specified.
  __device__ static float* Stage(const Tile<__half>& tile, const Sum& sum) {
    float* staging = tile.staging + threadIdx.x / kWarpThreads * kEdge * kEdge;
    __syncwarp();  // earlier readers have finished
    nvcuda::wmma::store_matrix_sync(staging, sum, kEdge, nvcuda::wmma::mem_row_major);
    __syncwarp();
    return staging;
  }

  // gradient[kEdge][row] += sum * factor
  __device__ static void AddTo(float* gradient, int row, const Sum& sum, float factor) {
    Sum total;
    nvcuda::wmma::load_matrix_sync(total, gradient, row, nvcuda::wmma::mem_row_major);
    for (int i = 0; i < total.num_elements; ++i) total.x[i] += sum.x[i] * factor;
    nvcuda::wmma::store_matrix_sync(gradient, total, row, nvcuda::wmma::mem_row_major);
  }

  // Stores two adjacent values; `to` has an even index in its row.
  __device__ static void StorePair(__half* to, float first, float second) {
    *reinterpret_cast<__half2*>(to) = __half2{Rounded<__half>(first), Rounded<__half>(second)};
  }

  // Rounds the weights to half precision. A barrier must follow.
  __device__ static void Prepare(const DeviceField& field, Tile<__half>& tile) {
    const int pairs = tile.hidden / 2;
    for (int i = threadIdx.x; i < tile.features * pairs; i += kTileSamples) {
      const float* from = field.parameters + 2 * i;
      StorePair(tile.in_weight + i / pairs * tile.hidden_row + 2 * (i % pairs), from[0], from[1]);
    }
    const float* out = field.parameters + tile.features * tile.hidden;
    for (int i = threadIdx.x; i < kEdge * pairs; i += kTileSamples) {
      const bool used = i < kOutputs * pairs;
      StorePair(tile.out_weight + i / pairs * tile.hidden_row + 2 * (i % pairs), used ? out[2 * i] : 0.0f,
                used ? out[2 * i + 1] : 0.0f);
    }
  }

  // tile.feature -> tile.neuron, tile.raw; each warp processes its own rows.
  __device__ static void Forward(const DeviceField&, Tile<__half>& tile) {
    const int lane = threadIdx.x % kWarpThreads, first = threadIdx.x - lane;
    for (int row = first; row < first + kRowsOfWarp; row += kEdge) {
      for (int n = 0; n < tile.hidden; n += kEdge) {
        Sum sum;
        nvcuda::wmma::fill_fragment(sum, 0.0f);
        Multiply<RowMajor, RowMajor>(tile.feature + row * tile.feature_row, tile.feature_row, kEdge, tile.in_weight + n,
                                     tile.hidden_row, kEdge * tile.hidden_row, tile.features / kEdge, sum);
        const float* staging = Stage(tile, sum);
        for (int e = 2 * lane; e < kEdge * kEdge; e += 2 * kWarpThreads) {
          StorePair(tile.neuron + (row + e / kEdge) * tile.hidden_row + n + e % kEdge, plain::Max(staging[e], 0.0f),
                    plain::Max(staging[e + 1], 0.0f));
        }
      }
      __syncwarp();
      Sum sum;
      nvcuda::wmma::fill_fragment(sum, 0.0f);
      Multiply<RowMajor, ColMajor>(tile.neuron + row * tile.hidden_row, tile.hidden_row, kEdge, tile.out_weight,
                                   tile.hidden_row, kEdge, tile.hidden / kEdge, sum);
      const float* staging = Stage(tile, sum);
      for (int e = lane; e < kEdge * kOutputs; e += kWarpThreads) {
        tile.raw[row * kOutputs + e] = staging[e / kOutputs * kEdge + e % kOutputs];
      }
    }
  }

  // The adjoint, from the derivatives in tile.raw; see FloatMlp::Backward. Derivatives in half precision are multiplied
  // by `scale`, a power of two, so that they neither underflow nor overflow.
  __device__ static void Backward(const DeviceField& field, Tile<__half>& tile, float scale, float* table_gradient) {
    const int warp = threadIdx.x / kWarpThreads;
    const int columns = tile.hidden / kEdge, sample_tiles = kTileSamples / kEdge;
    __half* d_output = tile.d_output + threadIdx.x * Tile<__half>::kOutputRow;
    for (int o = 0; o < kEdge; ++o) {
      d_output[o] = Rounded<__half>(o < kOutputs ? tile.raw[threadIdx.x * kOutputs + o] * scale : 0.0f);
    }
    __syncthreads();
    for (int c = warp; c < columns; c += kTileWarps) {
      Sum sum;
      nvcuda::wmma::fill_fragment(sum, 0.0f);
      Multiply<ColMajor, RowMajor>(tile.d_output, Tile<__half>::kOutputRow, kEdge * Tile<__half>::kOutputRow,
                                   tile.neuron + c * kEdge, tile.hidden_row, kEdge * tile.hidden_row, sample_tiles,
                                   sum);
      AddTo(tile.weight_gradient + tile.features * tile.hidden + c * kEdge, tile.hidden, sum, 1.0f / scale);
    }
    __syncthreads();
    BackwardThroughRelu(tile);
    __syncthreads();
    for (int i = warp; i < columns * (tile.features / kEdge); i += kTileWarps) {
      const int f = i / columns * kEdge, n = i % columns * kEdge;
      Sum sum;
      nvcuda::wmma::fill_fragment(sum, 0.0f);
      Multiply<ColMajor, RowMajor>(tile.feature + f, tile.feature_row, kEdge * tile.feature_row, tile.neuron + n,
                                   tile.hidden_row, kEdge * tile.hidden_row, sample_tiles, sum);
      AddTo(tile.weight_gradient + f * tile.hidden + n, tile.hidden, sum, 1.0f / scale);
    }
    BackwardToTable(field, tile, 1.0f / scale, table_gradient);
  }

 private:
  // Replaces tile.neuron by its gradient; each warp processes its own rows.
  __device__ static void BackwardThroughRelu(Tile<__half>& tile) {
    const int lane = threadIdx.x % kWarpThreads, first = threadIdx.x - lane;
    for (int row = first; row < first + kRowsOfWarp; row += kEdge) {
      for (int n = 0; n < tile.hidden; n += kEdge) {
        Sum sum;
        nvcuda::wmma::fill_fragment(sum, 0.0f);
        Multiply<RowMajor, RowMajor>(tile.d_output + row * Tile<__half>::kOutputRow, Tile<__half>::kOutputRow, kEdge,
                                     tile.out_weight + n, tile.hidden_row, kEdge, 1, sum);
        const float* staging = Stage(tile, sum);
        for (int e = 2 * lane; e < kEdge * kEdge; e += 2 * kWarpThreads) {
          __half* neuron = tile.neuron + (row + e / kEdge) * tile.hidden_row + n + e % kEdge;
          StorePair(neuron, plain::Lane<float>::IfPositive(__half2float(neuron[0]), staging[e]),
                    plain::Lane<float>::IfPositive(__half2float(neuron[1]), staging[e + 1]));
        }
      }
    }
  }

  // Scatters the gradients of the features; each warp processes its own rows.
  __device__ static void BackwardToTable(const DeviceField& field, const Tile<__half>& tile, float factor,
                                         float* table_gradient) {
    constexpr int kLevels = kEdge / kFeaturesPerLevel;  // per tile of features
    const int lane = threadIdx.x % kWarpThreads, first = threadIdx.x - lane;
    for (int row = first; row < first + kRowsOfWarp; row += kEdge) {
      if (!__any_sync(kWholeWarp, tile.active[row + lane % kEdge])) continue;
      for (int f = 0; f < tile.features; f += kEdge) {
        Sum sum;
        nvcuda::wmma::fill_fragment(sum, 0.0f);
        Multiply<RowMajor, ColMajor>(tile.neuron + row * tile.hidden_row, tile.hidden_row, kEdge,
                                     tile.in_weight + f * tile.hidden_row, tile.hidden_row, kEdge, tile.hidden / kEdge,
                                     sum);
        const float* staging = Stage(tile, sum);
        for (int e = lane; e < kEdge * kLevels; e += kWarpThreads) {
          const int s = row + e / kLevels, level = f / kFeaturesPerLevel + e % kLevels;
          if (level >= field.grid.levels || !tile.active[s]) continue;
          const float* scaled = staging + kFeaturesPerLevel * e;
          const float d_feature[kFeaturesPerLevel] = {scaled[0] * factor, scaled[1] * factor};
          ScatterLevel(field.grid, table_gradient, level, tile.x[s], tile.y[s], tile.z[s], d_feature);
        }
      }
    }
  }
};

}  // namespace romap::nerf::cuda
