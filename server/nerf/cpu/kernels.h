#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "server/nerf/math/loss_weights.h"
#include "server/nerf/math/sample_budget.h"
#include "server/nerf/math/types.h"
#include "server/nerf/model/field_model.h"

namespace romap::nerf {

// Widest vector of any kernel, in floats. Arrays passed to kernels have this many readable and writable values after
// their last sample, because kernels process whole vectors.
inline constexpr int kMaxLanes = 16;

// Defines where and how densely rays are sampled.
struct SamplingRule {
  const uint32_t* occupied_bits = nullptr;  // kOccupancyResolution^3 bits, x fastest
  std::array<float, 3> extent = {1, 1, 1};  // of the box in Unit space
  SampleBudget budget;
};

// Sample arrays of one chunk of rays, reused for every chunk. The first `size` samples are in use.
struct SampleChunk {
  SampleChunk(int capacity, int features, int hidden);

  int capacity;
  int size = 0;
  AlignedBuffer<float> x, y, z;           // in Unit space of the box; after to_grid, of the grid
  AlignedBuffer<float> t, length;         // along the ray, and of the step; units of box side
  AlignedBuffer<uint32_t> cell;           // of the occupancy grid
  AlignedBuffer<float> features;          // [capacity][features]; after the backward pass their gradient
  AlignedBuffer<float> hidden;            // [capacity][hidden]
  AlignedBuffer<float> raw;               // [capacity][kOutputs], before activation
  AlignedBuffer<float> d_raw;             // [capacity][kOutputs]
  AlignedBuffer<float> red, green, blue;  // 0..1
  AlignedBuffer<float> density, alpha;    // per box side; opacity of the step
  AlignedBuffer<float> transmittance;     // of signed-distance fields: see TransmittanceAtRaw
  AlignedBuffer<float> weight, behind;    // see CompositeForward
  AlignedBuffer<uint32_t> active;         // indices of the samples that keep_active kept
};

// The inner loops: one table per instruction set, and one in plain floats. All arrays are aligned to 64 bytes.
struct KernelTable {
  std::string name;

  // Places samples on `rays` and appends them to `chunk` (x, y, z, t, length, cell); `spans` has one entry per ray.
  void (*place_samples)(const Ray* rays, int ray_count, const SamplingRule& rule, SampleChunk& chunk, RaySpan* spans);

  // Transforms points from the Unit space of the box to that of the grid.
  void (*to_grid)(const GridPose& pose, int count, float* x, float* y, float* z);

  // features[count][layout.features] of points in Unit space of the grid.
  void (*encode)(const GridLayout& layout, const float* table, int count, const float* x, const float* y,
                 const float* z, float* features);
  // Adds to gradient[entries][2].
  void (*encode_backward)(const GridLayout& layout, int count, const float* x, const float* y, const float* z,
                          const float* d_features, float* gradient);

  // hidden[count][hidden] after ReLU, raw[count][kOutputs] without density bias.
  void (*mlp_forward)(const MlpWeights& mlp, int count, const float* features, float* hidden, float* raw);
  // Adds to gradient (same layout as MlpWeights::parameters). Overwrites `features` with their gradient, and `hidden`.
  void (*mlp_backward)(const MlpWeights& mlp, int count, float* features, float* hidden, const float* d_raw,
                       float* gradient);

  // raw, length -> red, green, blue, density, alpha of the chunk's samples.
  void (*activate)(SampleChunk& chunk, float density_bias);

  // Opacities of signed-distance fields; call after `activate`. They depend on adjacent samples
  // (math/signed_distance.h). Density and length are set to 1, so that d_raw from `composite` is the derivative with
  // respect to the optical depth in front of a sample; distance_backward converts it to the derivative with respect to
  // the raw output.
  void (*distance_opacity)(const RaySpan* spans, int ray_count, float sharpness, SampleChunk& chunk);
  void (*distance_backward)(const RaySpan* spans, int ray_count, float sharpness, SampleChunk& chunk);

  // Renders rays and computes their losses and the adjoint of both (math/composite.h, math/losses.h). Writes weight,
  // behind and d_raw of the samples in the chunk, and one entry of `results` per ray; the entries of rays without
  // samples are unchanged. A ray whose partner is not in the chunk or has no samples is treated as a ray without a
  // partner.
  void (*composite)(const Ray* rays, const RaySpan* spans, int ray_count, const LossWeights& weights,
                    SampleChunk& chunk, RayResult* results);

  // Moves the samples with a GradientSize of d_raw above `cut` to the front, in their order: x, y, z, features, hidden
  // and d_raw, which is also multiplied by `scale`. Returns their number; the contents after them are unspecified.
  int (*keep_active)(float cut, float scale, int features, int hidden, SampleChunk& chunk);

  // Sums `gradient_count` gradient arrays, zeroes them, and updates parameters [begin, end), both multiples of
  // kMaxLanes.
  void (*adam)(const AdamRates& rates, size_t begin, size_t end, float* parameters, float* first, float* second,
               float* const* gradients, int gradient_count);

  // Kernels for all encodings and MLP depths; null in the general table itself. The general MLP kernels do not use
  // `hidden`.
  const KernelTable* general = nullptr;

  // The table that can run `model`.
  const KernelTable& For(const FieldModel& model) const { return model.NeedsGeneralKernels() ? *general : *this; }
};

const KernelTable& PlainKernels();
// The table for the best instruction set of this machine (Highway's dynamic dispatch).
const KernelTable& SimdKernels();

}  // namespace romap::nerf
