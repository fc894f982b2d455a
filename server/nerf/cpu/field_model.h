#pragma once

#include <cstdint>

#include "server/nerf/cpu/aligned_buffer.h"
#include "server/nerf/math/types.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Levels grow geometrically from `base_resolution` to `finest_resolution` cells per unit. For the frequency encoding
// they are octaves, and there is no table.
GridLayout MakeGridLayout(const NerfConfig& config);

// The weights of the MLP (no biases) in both orders, so that every product reads rows: forward and its adjoint.
struct MlpWeights {
  int inputs = 0;  // GridLayout::features
  int hidden = 0;  // multiple of 16
  int layers = 1;  // hidden layers
  // What is trained: [inputs][hidden], (layers - 1) times [hidden][hidden], then [kOutputs][hidden].
  AlignedBuffer<float> parameters;
  AlignedBuffer<float> in_transposed;      // [hidden][inputs]
  AlignedBuffer<float> hidden_transposed;  // [layers - 1][hidden][hidden], each transposed
  AlignedBuffer<float> out_transposed;     // [hidden][kOutputs]

  MlpWeights() = default;
  MlpWeights(int inputs, int hidden, int layers = 1);
  // To be called after every change of `parameters`.
  void UpdateTransposed();
  MlpWeights Clone() const;

  // Where the weights into hidden layer `layer` (1 .. layers - 1) and those of the outputs begin in `parameters`.
  int HiddenOffset(int layer) const { return inputs * hidden + (layer - 1) * hidden * hidden; }
  int OutOffset() const { return HiddenOffset(layers); }
  const float* in_weights() const { return parameters.data(); }
  const float* hidden_weights(int layer) const { return parameters.data() + HiddenOffset(layer); }
  const float* hidden_weights_transposed(int layer) const {
    return hidden_transposed.data() + (layer - 1) * hidden * hidden;
  }
  const float* out_weights() const { return parameters.data() + OutOffset(); }
};

// Everything a point needs to be evaluated.
struct FieldModel {
  GridLayout layout;
  AlignedBuffer<float> table;  // [entries][2]
  MlpWeights mlp;
  float density_bias = 0;  // added to the raw density output, so that `raw` below and in snapshots includes it
  float sharpness = 0;     // > 0: a field of signed distances (signed_distance.h), which has no bias; per box side

  FieldModel() = default;
  // Table uniform in +-1e-4, MLP uniform within Glorot and Bengio's bound (2010), between hidden layers within that of
  // He et al. (2015), which lets signals through many of them; the same for the same seed.
  FieldModel(const NerfConfig& config, uint64_t seed);
  FieldModel Clone() const;
  bool IsFinite() const;
  bool IsDistance() const { return sharpness > 0; }
  // Whether it is anything else than a hash grid with one hidden layer: see KernelTable::general.
  bool NeedsGeneralKernels() const { return layout.octaves > 0 || mlp.layers > 1; }
};

}  // namespace romap::nerf
