#pragma once

#include <cstdint>

#include "server/nerf/cpu/aligned_buffer.h"
#include "server/nerf/math/types.h"
#include "server/nerf/nerf_config.h"

namespace romap::nerf {

// Levels grow geometrically from `base_resolution` to `finest_resolution` cells per unit.
GridLayout MakeGridLayout(const NerfConfig& config);

// The weights of the MLP (no biases) in both orders, so that every product reads rows: forward and its adjoint.
struct MlpWeights {
  int inputs = 0;                       // GridLayout::features
  int hidden = 0;                       // multiple of 16
  AlignedBuffer<float> parameters;      // what is trained: [inputs][hidden], then [kOutputs][hidden]
  AlignedBuffer<float> in_transposed;   // [hidden][inputs]
  AlignedBuffer<float> out_transposed;  // [hidden][kOutputs]

  MlpWeights() = default;
  MlpWeights(int inputs, int hidden);
  // To be called after every change of `parameters`.
  void UpdateTransposed();
  MlpWeights Clone() const;

  const float* in_weights() const { return parameters.data(); }
  const float* out_weights() const { return parameters.data() + inputs * hidden; }
};

// Everything a point needs to be evaluated.
struct FieldModel {
  GridLayout layout;
  AlignedBuffer<float> table;  // [entries][2]
  MlpWeights mlp;
  float density_bias = 0;  // added to the raw density output, so that `raw` below and in snapshots includes it

  FieldModel() = default;
  // Table uniform in +-1e-4, MLP uniform within Glorot and Bengio's bound (2010); the same for the same seed.
  FieldModel(const NerfConfig& config, uint64_t seed);
  FieldModel Clone() const;
  bool IsFinite() const;
};

}  // namespace romap::nerf
