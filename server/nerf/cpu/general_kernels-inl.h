// Kernels for the frequency encoding and for MLPs of several hidden layers, which the fast kernels do not support.
// Baselines and ablations use them. Included by plain_kernels.cc and simd_kernels.cc like kernels-inl.h.
#include "server/nerf/cpu/kernels-inl.h"
#include "server/nerf/math/frequency.h"

#if defined(ROMAP_NERF_CPU_GENERAL_KERNELS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef HWY_TARGET_TOGGLE
#undef ROMAP_NERF_CPU_GENERAL_KERNELS_INL
#else
#define ROMAP_NERF_CPU_GENERAL_KERNELS_INL
#endif

ROMAP_MATH_BEGIN

// ----------------------------------------------------------------------------------------------------------- encoding

// The waves of all features of a frequency encoding, see FrequencyFeature. The sine of (axis, octave k) is feature
// 2 (axis octaves + k), the cosine is the next one.
struct FrequencyWaves {
  alignas(64) float along[3][kMaxFrequencyFeatures] = {};
  alignas(64) float phase[kMaxFrequencyFeatures] = {};

  explicit FrequencyWaves(int octaves) {
    for (int axis = 0; axis < 3; ++axis) {
      for (int k = 0; k < octaves; ++k) {
        const int sine = 2 * (axis * octaves + k);
        along[axis][sine] = along[axis][sine + 1] = static_cast<float>(1 << k);
        phase[sine + 1] = 0.5f;
      }
    }
  }
};

template <class Wide>
void EncodeFrequency(const GridLayout& layout, int count, const float* x, const float* y, const float* z,
                     float* features) {
  using L = Lane<Wide>;
  const FrequencyWaves waves(layout.octaves);
  const int wave_count = 6 * layout.octaves;
  for (int i = 0; i < count; ++i, features += layout.features) {
    for (int f = 0; f < wave_count; f += L::kLanes) {  // whole vectors fit, because `features` is a multiple of 16
      const Wide wave =
          FrequencyFeature(L::Load(waves.along[0] + f), L::Load(waves.along[1] + f), L::Load(waves.along[2] + f),
                           L::Load(waves.phase + f), L::Set(x[i]), L::Set(y[i]), L::Set(z[i]));
      L::Store(wave, features + f);
    }
    features[wave_count] = x[i];
    features[wave_count + 1] = y[i];
    features[wave_count + 2] = z[i];
    features[wave_count + 3] = 1.0f;  // the first layer's bias
    for (int f = wave_count + kFrequencyExtras; f < layout.features; ++f) features[f] = 0.0f;
  }
}

// kEncode, kEncodeBackward: the hash grid kernels.
template <class Wide, auto kEncode>
void EncodeGeneral(const GridLayout& layout, const float* table, int count, const float* x, const float* y,
                   const float* z, float* features) {
  if (layout.octaves > 0) {
    EncodeFrequency<Wide>(layout, count, x, y, z, features);
  } else {
    kEncode(layout, table, count, x, y, z, features);
  }
}

template <auto kEncodeBackward>
void EncodeBackwardGeneral(const GridLayout& layout, int count, const float* x, const float* y, const float* z,
                           const float* d_features, float* gradient) {
  if (layout.octaves > 0) return;  // the frequency encoding has no learned parameters
  kEncodeBackward(layout, count, x, y, z, d_features, gradient);
}

// ---------------------------------------------------------------------------------------------------------------- MLP

// Activations of a block of samples: [kMaxHiddenLayers][kDeepBlock][hidden].
inline constexpr int kDeepBlock = 48;
struct DeepActivations {
  alignas(64) float values[kMaxHiddenLayers * kDeepBlock * kMaxDeepWidth];
  float* Layer(int layer, int hidden) { return values + layer * kDeepBlock * hidden; }
};

template <class Wide>
void DeepHidden(const MlpWeights& mlp, int rows, const float* features, DeepActivations& activations) {
  const int width = mlp.hidden;
  Dense<Wide, DenseMode::kRelu>(rows, features, mlp.inputs, mlp.in_weights(), width, activations.Layer(0, width));
  for (int layer = 1; layer < mlp.layers; ++layer) {
    Dense<Wide, DenseMode::kRelu>(rows, activations.Layer(layer - 1, width), width, mlp.hidden_weights(layer), width,
                                  activations.Layer(layer, width));
  }
}

template <class Wide, class Output>
void DeepForward(const MlpWeights& mlp, int count, const float* features, float* /*hidden*/, float* raw) {
  DeepActivations activations;
  for (int begin = 0; begin < count; begin += kDeepBlock) {
    const int rows = std::min(kDeepBlock, count - begin);
    DeepHidden<Wide>(mlp, rows, features + begin * mlp.inputs, activations);
    Output::Run(mlp, rows, activations.Layer(mlp.layers - 1, mlp.hidden), raw + begin * kOutputs);
  }
}

// Recomputes the activations: those of all layers and samples of a chunk would not fit into the cache, and about half
// of the samples need no backward pass.
template <class Wide>
void DeepBackward(const MlpWeights& mlp, int count, float* features, float* /*hidden*/, const float* d_raw,
                  float* gradient) {
  const int width = mlp.hidden;
  DeepActivations activations;
  for (int begin = 0; begin < count; begin += kDeepBlock) {
    const int rows = std::min(kDeepBlock, count - begin);
    float* x = features + begin * mlp.inputs;
    const float* d = d_raw + begin * kOutputs;
    DeepHidden<Wide>(mlp, rows, x, activations);
    float* above = activations.Layer(mlp.layers - 1, width);
    Outer<Wide>(rows, d, kOutputs, above, width, gradient + mlp.OutOffset());
    Dense<Wide, DenseMode::kMaskedByOut>(rows, d, kOutputs, mlp.out_weights(), width, above);
    for (int layer = mlp.layers - 1; layer > 0; --layer) {
      float* below = activations.Layer(layer - 1, width);
      Outer<Wide>(rows, below, width, above, width, gradient + mlp.HiddenOffset(layer));
      Dense<Wide, DenseMode::kMaskedByOut>(rows, above, width, mlp.hidden_weights_transposed(layer), width, below);
      above = below;
    }
    Outer<Wide>(rows, x, mlp.inputs, above, width, gradient);
    Dense<Wide, DenseMode::kLinear>(rows, above, width, mlp.in_transposed.data(), mlp.inputs, x);
  }
}

// Returns `fast` with a pointer to the general table of the same instruction set. Call once per instruction set.
template <class Wide, class Output, auto kEncode, auto kEncodeBackward>
KernelTable WithGeneralKernels(KernelTable fast) {
  static KernelTable general = fast;
  general.name += ", general";
  general.encode = EncodeGeneral<Wide, kEncode>;
  general.encode_backward = EncodeBackwardGeneral<kEncodeBackward>;
  general.mlp_forward = DeepForward<Wide, Output>;
  general.mlp_backward = DeepBackward<Wide>;
  fast.general = &general;
  return fast;
}

ROMAP_MATH_END

#endif
