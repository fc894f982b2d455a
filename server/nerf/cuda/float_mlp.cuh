#pragma once

// The MLP of a tile in single precision, one thread per sample or weight: the same formulas as on the CPU, the
// reference for TensorMlp.

#include "server/nerf/cuda/grid_access.cuh"
#include "server/nerf/cuda/tile.cuh"
#include "server/nerf/math/dense.h"

namespace romap::nerf::cuda {

struct FloatMlp {
  using Factor = float;
  using DenseMode = plain::DenseMode;

  __device__ static const float* OutWeights(const DeviceField& field) {
    return field.parameters + field.grid.features * field.hidden;
  }

  // Nothing to do: the weights are read from device memory.
  __device__ static void Prepare(const DeviceField&, Tile<float>&) {}

  // tile.feature -> tile.neuron, tile.raw; each warp processes its own rows.
  __device__ static void Forward(const DeviceField& field, Tile<float>& tile) {
    const int s = threadIdx.x;
    const float* feature = tile.feature + s * tile.feature_row;
    float* neuron = tile.neuron + s * tile.hidden_row;
    for (int n = 0; n < tile.hidden; ++n) {
      plain::DenseTile<float, 1, 1, DenseMode::kRelu>(feature, tile.features, tile.features, field.parameters + n,
                                                      tile.hidden, neuron + n);
    }
    for (int o = 0; o < kOutputs; ++o) {
      // A row of the weights read as a column: stride 1 along k.
      plain::DenseTile<float, 1, 1, DenseMode::kLinear>(
          neuron, tile.hidden, tile.hidden, OutWeights(field) + o * tile.hidden, 1, tile.raw + s * kOutputs + o);
    }
  }

  // The adjoint, from the derivatives in tile.raw: adds to tile.weight_gradient and `table_gradient`. All threads of
  // the block must call it, after a barrier. The scale of TensorMlp is not needed here.
  __device__ static void Backward(const DeviceField& field, Tile<float>& tile, float, float* table_gradient) {
    const int s = threadIdx.x;
    float* out_gradient = tile.weight_gradient + tile.features * tile.hidden;
    for (int w = s; w < kOutputs * tile.hidden; w += kTileSamples) {
      plain::OuterTile<float, 1, 1>(kTileSamples, tile.raw + w / tile.hidden, kOutputs, tile.neuron + w % tile.hidden,
                                    tile.hidden_row, out_gradient + w);
    }
    __syncthreads();
    float* neuron = tile.neuron + s * tile.hidden_row;  // replaced by its gradient
    for (int n = 0; n < tile.hidden; ++n) {
      plain::DenseTile<float, 1, 1, DenseMode::kMaskedByOut>(tile.raw + s * kOutputs, kOutputs, kOutputs,
                                                             OutWeights(field) + n, tile.hidden, neuron + n);
    }
    __syncthreads();
    for (int w = s; w < tile.features * tile.hidden; w += kTileSamples) {
      plain::OuterTile<float, 1, 1>(kTileSamples, tile.feature + w / tile.hidden, tile.feature_row,
                                    tile.neuron + w % tile.hidden, tile.hidden_row, tile.weight_gradient + w);
    }
    if (!tile.active[s]) return;
    for (int level = 0; level < field.grid.levels; ++level) {
      float d_feature[kFeaturesPerLevel];
      for (int f = 0; f < kFeaturesPerLevel; ++f) {
        const float* weights = field.parameters + (kFeaturesPerLevel * level + f) * tile.hidden;
        plain::DenseTile<float, 1, 1, DenseMode::kLinear>(neuron, tile.hidden, tile.hidden, weights, 1, d_feature + f);
      }
      ScatterLevel(field.grid, table_gradient, level, tile.x[s], tile.y[s], tile.z[s], d_feature);
    }
  }
};

}  // namespace romap::nerf::cuda
