#pragma once

#include <cstdint>

#include "server/nerf/math/types.h"
#include "server/nerf/model/aligned_buffer.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Resolutions grow geometrically from `base_resolution` to `finest_resolution` cells per unit. For the frequency
// encoding the levels are octaves and there is no table.
GridLayout MakeGridLayout(const NerfConfig& config);

// Weights of the MLP (no biases), each matrix also transposed, so that forward and backward products both read rows.
struct MlpWeights {
  int inputs = 0;  // GridLayout::features
  int hidden = 0;  // multiple of 16
  int layers = 1;  // hidden layers
  // The trained parameters: [inputs][hidden], (layers - 1) times [hidden][hidden], then [kOutputs][hidden].
  AlignedBuffer<float> parameters;
  AlignedBuffer<float> in_transposed;      // [hidden][inputs]
  AlignedBuffer<float> hidden_transposed;  // [layers - 1][hidden][hidden], each transposed
  AlignedBuffer<float> out_transposed;     // [hidden][kOutputs]

  MlpWeights() = default;
  MlpWeights(int inputs, int hidden, int layers = 1);
  // Call after every change of `parameters`.
  void UpdateTransposed();
  MlpWeights Clone() const;

  // Offset in `parameters` of the weights into hidden layer `layer` (1 .. layers - 1), and of the output weights.
  int HiddenOffset(int layer) const { return inputs * hidden + (layer - 1) * hidden * hidden; }
  int OutOffset() const { return HiddenOffset(layers); }
  const float* in_weights() const { return parameters.data(); }
  const float* hidden_weights(int layer) const { return parameters.data() + HiddenOffset(layer); }
  const float* hidden_weights_transposed(int layer) const {
    return hidden_transposed.data() + (layer - 1) * hidden * hidden;
  }
  const float* out_weights() const { return parameters.data() + OutOffset(); }
};

// Everything needed to evaluate the field at a point.
struct FieldModel {
  GridLayout layout;
  AlignedBuffer<float> table;  // [entries][2]
  MlpWeights mlp;
  float density_bias = 0;  // added to the raw density output; raw values in snapshots include it
  float sharpness = 0;     // > 0: a signed-distance field (signed_distance.h), which has no bias; per box side

  FieldModel() = default;
  // Table uniform in +-1e-4; MLP uniform within the bound of Glorot and Bengio (2010), between hidden layers within
  // that of He et al. (2015), which keeps the scale of signals through many layers. Depends only on the seed.
  FieldModel(const NerfConfig& config, uint64_t seed);
  FieldModel Clone() const;
  bool IsFinite() const;
  bool IsDistance() const { return sharpness > 0; }
  // Whether the model needs the general kernels; false for a hash grid with one hidden layer, see KernelTable::general.
  bool NeedsGeneralKernels() const { return layout.octaves > 0 || mlp.layers > 1; }
};

}  // namespace romap::nerf
