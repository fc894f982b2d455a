#pragma once

// The field engine's inner loops as CUDA kernels: memory and launches here, formulas in math/, shared with the CPU. A
// training step is three launches, made to be captured in a graph once and replayed: what differs from step to step is
// read from device memory.
//
// Pointers in the structs below point to device memory. Launches are asynchronous on `stream` and return what
// cudaGetLastError says about them; errors during the run show at the next synchronisation.

#include <cstddef>
#include <cstdint>

#include "server/nerf/cuda/cuda_launch.h"
#include "server/nerf/math/sampling.h"
#include "server/nerf/math/types.h"

namespace romap::nerf::cuda {

inline constexpr int kMaxFeatures = kFeaturesPerLevel * kMaxLevels;
inline constexpr int kMaxHidden = 128;
inline constexpr int kWarpThreads = 32;
inline constexpr unsigned kWholeWarp = 0xffffffffu;
inline constexpr int kTileSamples = 128;  // samples that a block works on at a time, a thread each
inline constexpr int kMaxStepBlocks = 256;
inline constexpr int kCells = kOccupancyResolution * kOccupancyResolution * kOccupancyResolution;
inline constexpr int kLayers = 3 * kOccupancyResolution;
inline constexpr float kLayerUnit = 1.0f / (1 << 20);  // of StepParams::layer_weight

// How the products of the MLP are made.
enum class MlpPath {
  kTensorCores,  // factors rounded to half precision, sums in single precision
  kFloat,        // single precision throughout, in the CPU's order of sums
};

// A FieldModel whose arrays lie on the device.
struct DeviceField {
  GridLayout grid;
  const float* table;       // [grid.entries][2]
  const float* parameters;  // of the MLP: [grid.features][hidden], then [kOutputs][hidden]
  int hidden;               // a multiple of 16, <= kMaxHidden
  float density_bias;
};

// Values of the field at `count` points of the grid's Unit space.
struct EvaluateParams {
  DeviceField field;
  int count;
  const float* x;  // [count]
  const float* y;
  const float* z;
  float* value;  // out, [count][kOutputs]: red, green, blue 0..1, raw density with its bias
};
cudaError_t LaunchEvaluate(const EvaluateParams& params, MlpPath path, cudaStream_t stream);

// What the steps of one upload have in common, and how far they are.
struct SliceState {
  uint32_t next;        // step of the upload that begins next
  uint32_t running;     // the one that runs
  uint64_t first_step;  // of the upload, counted since training began
  float extent[3];      // of the box in Unit space
  GridPose grid;        // of the box
};

// Added up over steps; see TrainStats.
struct StepCounters {
  unsigned long long rays, samples, active_samples;
};

// When the occupied cells are made anew: after every `interval`-th step from step `start` on.
struct OccupancyPlan {
  uint64_t start, interval;
};

// Rays to gradients: sampling, encoding, MLP, rendering, losses, and all of their adjoints. A block takes tiles of
// whole rays, one tile after another, and keeps everything between rays and gradients in shared memory.
struct StepParams {
  DeviceField field;
  SliceState* slice;
  StepCounters* counters;
  const Ray* rays;    // [steps of the upload][rays_per_step]
  float* color_loss;  // out, laid out as `rays`: squared colour error; < 0 where a ray has none
  int rays_per_step;
  SampleBudget budget;
  LossWeights loss_weights;
  float gradient_cut;                // samples whose |d_raw| sums to no more are left out, as on the CPU
  const uint32_t* occupied_bits;     // see Occupancy::bits
  uint32_t* cell_visits;             // [kCells], counts samples
  uint32_t* cell_weight;             // [kCells], bits of the largest weight, a float >= 0; this order is that of floats
  unsigned long long* layer_weight;  // [3][kOccupancyResolution], in units of kLayerUnit: integers add in any order
  float* table_gradient;             // [grid.entries][2], added to
  float* mlp_partial;                // out, [(grid.features + kOutputs) hidden][StepBlocks()], one sum per block
};

// Gradients to parameters, and the occupancy's scores.
struct OptimiseParams {
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
  uint32_t* live_bits;        // out when the plan says so, [kCells / 32]: hull cells whose score exceeds the threshold
};

// When the plan says so: the occupied cells from the live ones. Ends the step.
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
  OptimiseParams optimise;
  OccupancyParams occupancy;
};

// Blocks that work on a step; the same on every device, so that sums are made in the same order.
int StepBlocks(int rays_per_step, int most_samples);

// Dynamic shared memory of a block.
size_t StepSharedBytes(const DeviceField& field, const SampleBudget& budget, MlpPath path);

// To be called once for a shape before LaunchStep, not while a stream captures: asks for the shared memory.
// cudaErrorInvalidValue when the device has too little of it.
cudaError_t PrepareStep(const StepParams& params, MlpPath path);

// The first of the three launches of a step, and the other two.
cudaError_t LaunchGradients(const StepParams& params, MlpPath path, cudaStream_t stream);
cudaError_t LaunchOptimise(const StepLaunch& launch, cudaStream_t stream);

// The three launches of one step. The order in which blocks add to table_gradient is the device's, so that entries may
// differ in their last bits from run to run; all other sums are made in a fixed order.
cudaError_t LaunchStep(const StepLaunch& launch, MlpPath path, cudaStream_t stream);

}  // namespace romap::nerf::cuda
