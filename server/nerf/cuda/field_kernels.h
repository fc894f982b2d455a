#pragma once

// The field engine's inner loops as CUDA kernels: memory and launches here, formulas in math/, shared with the CPU.
// First form: plain kernels in single precision, one thread per point, sample, ray or parameter, no tensor cores.
//
// All pointers below point to device memory. Every launch is asynchronous on `stream` and returns what cudaGetLastError
// says about it; errors during the run show at the next synchronisation.

#include <cstddef>

#include "server/nerf/cuda/cuda_launch.h"
#include "server/nerf/math/types.h"

namespace romap::nerf::cuda {

inline constexpr int kMaxFeatures = kFeaturesPerLevel * kMaxLevels;
inline constexpr int kMaxHidden = 128;

// A FieldModel whose arrays lie on the device.
struct FieldView {
  GridLayout grid;
  const float* table;       // [grid.entries][2]
  const float* parameters;  // of the MLP: [grid.features][hidden], then [kOutputs][hidden]
  int hidden;               // <= kMaxHidden
  float density_bias;
};

// Values of the field at `count` points of Unit space.
struct EvaluateParams {
  FieldView field;
  int count;
  const float* x;  // [count], 0..1
  const float* y;
  const float* z;
  float* value;  // out, [count][kOutputs]: red, green, blue 0..1, raw density with its bias
};
cudaError_t LaunchEvaluate(const EvaluateParams& params, cudaStream_t stream);

// The samples of one step, all rays one after the other, and what the kernels of a step hand to each other.
struct SampleView {
  int count;
  const float* x;  // [count], Unit space
  const float* y;
  const float* z;
  const float* t;       // [count], along the ray, units of box side
  const float* length;  // [count], of the step, same units
  float* features;      // [count][grid.features]
  float* hidden;        // [count][hidden], after ReLU
  float* red;           // [count], 0..1
  float* green;
  float* blue;
  float* density;  // [count], per box side
  float* alpha;    // [count], opacity of the step
  float* weight;   // [count], see CompositeForward
  float* behind;
  float* d_raw;     // [count][kOutputs], gradient of the mean loss
  float* d_hidden;  // [count][hidden]
};

// Field at every sample: fills features, hidden and red .. alpha.
struct ForwardParams {
  FieldView field;
  SampleView samples;
};

// Rendering and losses of every ray, and their adjoint: fills weight, behind, d_raw.
struct CompositeParams {
  SampleView samples;
  int ray_count;
  const RaySpan* spans;      // [ray_count]; together they cover all samples
  const RayTarget* targets;  // [ray_count]
  LossWeights loss_weights;
  float gradient_cut;    // samples whose |d_raw| sums to no more are left out, as on the CPU
  float gradient_scale;  // 1 / rays of the step
  RayResult* results;    // out, [ray_count]; rays without samples keep theirs
};

// Adjoint of the field, but for the MLP's weights: fills d_hidden, adds to table_gradient.
struct BackwardParams {
  FieldView field;
  SampleView samples;
  float* table_gradient;  // [grid.entries][2]
};

// Adds to mlp_gradient what all samples say about the MLP's weights.
struct WeightGradientParams {
  SampleView samples;
  int features, hidden;
  float* mlp_gradient;  // laid out as FieldView::parameters
};

// One Adam step of `count` parameters; gradients are zeroed.
struct AdamParams {
  AdamRates rates;
  size_t count;
  float* parameters;
  float* first;  // moments
  float* second;
  float* gradient;
};

// One training step up to the gradients: forward, compositing, backward. Deterministic but for the order in which
// atomicAdd adds.
struct GradientStep {
  FieldView field;
  CompositeParams composite;
  float* table_gradient;
  float* mlp_gradient;
};
cudaError_t LaunchGradients(const GradientStep& step, cudaStream_t stream);

cudaError_t LaunchAdam(const AdamParams& params, cudaStream_t stream);

}  // namespace romap::nerf::cuda
