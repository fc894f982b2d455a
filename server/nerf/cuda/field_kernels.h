#pragma once

// The inner loops of training as CUDA kernels: memory and launches; the formulas are in math/ and shared with the CPU.
// A training step is three launches, which are captured in a graph once and then replayed: everything that changes from
// step to step is read from device memory.
//
// Pointers in the structs below point to device memory. Launches are asynchronous on `stream` and return the result of
// cudaGetLastError; errors during execution are reported by the next synchronization.

#include <cstddef>
#include <cstdint>

#include "server/nerf/cuda/cuda_launch.h"
#include "server/nerf/math/loss_weights.h"
#include "server/nerf/math/occupancy_rules.h"
#include "server/nerf/math/sample_budget.h"
#include "server/nerf/math/types.h"

namespace romap::nerf::cuda {

inline constexpr int kMaxFeatures = kFeaturesPerLevel * kMaxLevels;
inline constexpr int kMaxHidden = 128;
inline constexpr int kWarpThreads = 32;
inline constexpr unsigned kWholeWarp = 0xffffffffu;
inline constexpr int kTileSamples = 128;  // samples that a block processes at a time, one per thread
inline constexpr int kMaxStepBlocks = 256;
inline constexpr int kCells = kOccupancyResolution * kOccupancyResolution * kOccupancyResolution;
inline constexpr int kLayers = 3 * kOccupancyResolution;
inline constexpr float kLayerUnit = 1.0f / (1 << 20);  // of StepParams::layer_weight

// Method of the matrix products of the MLP.
enum class MlpPath {
  kTensorCores,  // factors rounded to half precision, sums in single precision
  kFloat,        // single precision, in the same order of summation as on the CPU
};

// A FieldModel in device memory.
struct DeviceField {
  GridLayout grid;
  const float* table;       // [grid.entries][2]
  const float* parameters;  // of the MLP: [grid.features][hidden], then [kOutputs][hidden]
  int hidden;               // a multiple of 16, <= kMaxHidden
  float density_bias;
};

// Values of the field at `count` points in Unit space of the grid.
struct EvaluateParams {
  DeviceField field;
  int count;
  const float* x;  // [count]
  const float* y;
  const float* z;
  float* value;  // out, [count][kOutputs]: red, green, blue 0..1, raw density with its bias
};
cudaError_t LaunchEvaluate(const EvaluateParams& params, MlpPath path, cudaStream_t stream);

// State shared by the steps of one upload.
struct SliceState {
  uint32_t next;        // index within the upload of the next step
  uint32_t running;     // index of the current step
  uint64_t first_step;  // number of steps before the upload, since training started
  float extent[3];      // of the box in Unit space
  GridPose grid;        // of the box
};

// Sums over steps; see TrainStats.
struct StepCounters {
  unsigned long long rays, samples, active_samples;
};

// First launch, from rays to gradients: sampling, encoding, MLP, rendering, losses, and their adjoints. A block
// processes tiles of whole rays, one tile after another, with all intermediate values in shared memory.
struct StepParams {
  DeviceField field;
  SliceState* slice;
  StepCounters* counters;
  const Ray* rays;    // [steps of the upload][rays_per_step]
  float* color_loss;  // out, layout of `rays`: squared color error of object rays, < 0 for other rays
  int rays_per_step;
  SampleBudget budget;
  LossWeights loss_weights;
  float gradient_cut;             // samples with a GradientSize up to this skip the backward pass
  const uint32_t* occupied_bits;  // see Occupancy::bits
  uint32_t* cell_visits;          // [kCells], number of samples
  uint32_t* cell_weight;  // [kCells], bits of the largest weight, a float >= 0: such bits compare as the floats do
  unsigned long long*
      layer_weight;       // [3][kOccupancyResolution], in units of kLayerUnit: sums of integers do not depend on order
  float* table_gradient;  // [grid.entries][2], added to
  float* mlp_partial;     // out, [(grid.features + kOutputs) hidden][StepBlocks()]: one sum per block
};

// Second launch: from gradients to parameters, and the scores of the occupancy.
struct OptimizeParams {
  const SliceState* slice;
  const float* learning_rate;  // [steps of the upload]
  float beta1, beta2;
  size_t table_count;  // floats
  float *table, *table_first, *table_second;
  float* table_gradient;  // zeroed
  int mlp_count;
  float *mlp, *mlp_first, *mlp_second;
  const float* mlp_partial;  // [mlp_count][step_blocks]
  int step_blocks;
  float* score;           // [kCells], see Occupancy
  uint32_t* cell_visits;  // zeroed
  uint32_t* cell_weight;  // zeroed
  float decay, threshold;
  OccupancyPlan plan;
  const uint32_t* hull_bits;  // [kCells / 32]
  uint32_t* live_bits;        // out if an update is due, [kCells / 32]: hull cells that are live
};

// Third launch: if an update is due, the occupied cells from the live ones. Ends the step.
struct OccupancyParams {
  SliceState* slice;
  OccupancyPlan plan;
  const uint32_t* live_bits;
  const uint32_t* hull_bits;
  uint32_t* occupied_bits;           // out
  unsigned long long* layer_weight;  // halved
};

struct StepLaunch {
  StepParams step;
  OptimizeParams optimize;
  OccupancyParams occupancy;
};

// Number of blocks of the first launch; the same on every device, so that sums have the same order on every device.
int StepBlocks(int rays_per_step, int max_samples);

// Dynamic shared memory of a block.
size_t StepSharedBytes(const DeviceField& field, const SampleBudget& budget, MlpPath path);

// Requests the shared memory. Call once per field before LaunchStep, not during capture. cudaErrorInvalidValue if the
// device has too little of it.
cudaError_t PrepareStep(const StepParams& params, MlpPath path);

// The first of the three launches of a step, and the other two.
cudaError_t LaunchGradients(const StepParams& params, MlpPath path, cudaStream_t stream);
cudaError_t LaunchOptimize(const StepLaunch& launch, cudaStream_t stream);

// The three launches of one step. The order in which blocks add to table_gradient is not specified, so entries may
// differ in their last bits from run to run; all other sums have a fixed order.
cudaError_t LaunchStep(const StepLaunch& launch, MlpPath path, cudaStream_t stream);

}  // namespace romap::nerf::cuda
