#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "server/nerf/cpu/field_model.h"
#include "server/nerf/math/types.h"

namespace romap::nerf {

// Widest vector any kernel uses, in floats. Arrays handed to kernels have this many readable and writable values behind
// their last sample; kernels work in whole vectors.
inline constexpr int kMaxLanes = 16;

struct SamplingRule {
  const uint32_t* occupied_bits = nullptr;  // kOccupancyResolution^3 bits, x fastest
  std::array<float, 3> extent = {1, 1, 1};  // of the box in Unit space
  float finest_step = 0.01f;                // samples are not set closer than this, down to min_samples
  int min_samples = 4;
  int max_samples = 16;
  bool skip_empty = true;  // false: max_samples between entry and exit of the box
};

// Sample arrays of one chunk of rays, reused from chunk to chunk. `size` samples are in use.
struct SampleChunk {
  SampleChunk(int capacity, int features, int hidden);

  int capacity;
  int size = 0;
  AlignedBuffer<float> x, y, z;           // Unit space of the box, then of the grid
  AlignedBuffer<float> t, length;         // along the ray and step, units of box side
  AlignedBuffer<uint32_t> cell;           // of the occupancy grid
  AlignedBuffer<float> features;          // [capacity][features]; backward: their gradient
  AlignedBuffer<float> hidden;            // [capacity][hidden]
  AlignedBuffer<float> raw;               // [capacity][kOutputs], before activation
  AlignedBuffer<float> d_raw;             // [capacity][kOutputs]
  AlignedBuffer<float> red, green, blue;  // 0..1
  AlignedBuffer<float> density, alpha;    // per box side; opacity of the step
  AlignedBuffer<float> light;             // of signed-distance fields: see LightAtRaw
  AlignedBuffer<float> weight, behind;    // see CompositeForward
  AlignedBuffer<uint32_t> active;         // numbers of the samples that keep_active chose
};

// The inner loops, one table per instruction set and one in plain floats. All arrays are aligned to 64 bytes.
struct KernelTable {
  std::string name;

  // Places samples on `rays` and appends them to `chunk` (x, y, z, t, length, cell); `spans` has one entry per ray.
  void (*place_samples)(const Ray* rays, int ray_count, const SamplingRule& rule, SampleChunk& chunk, RaySpan* spans);

  // Moves points from the Unit space of the box to that of the grid.
  void (*to_grid)(const GridPose& pose, int count, float* x, float* y, float* z);

  // features[count][layout.features] of points in the grid's Unit space.
  void (*encode)(const GridLayout& layout, const float* table, int count, const float* x, const float* y,
                 const float* z, float* features);
  // Adds to gradient[entries][2].
  void (*encode_backward)(const GridLayout& layout, int count, const float* x, const float* y, const float* z,
                          const float* d_features, float* gradient);

  // hidden[count][hidden] after ReLU, raw[count][kOutputs] without density bias.
  void (*mlp_forward)(const MlpWeights& mlp, int count, const float* features, float* hidden, float* raw);
  // Adds to gradient (laid out as MlpWeights::parameters). Overwrites `features` with their gradient and `hidden`.
  void (*mlp_backward)(const MlpWeights& mlp, int count, float* features, float* hidden, const float* d_raw,
                       float* gradient);

  // raw, length -> red, green, blue, density, alpha of the chunk's samples.
  void (*activate)(SampleChunk& chunk, float density_bias);

  // What activate does for density, for signed distances; to be called behind it. Opacities come of neighbouring
  // samples (see math/signed_distance.h), and density and length are set to 1: d_raw of `composite` is then the
  // derivative by the optical depth of a sample's stretch, which distance_backward turns into that by the raw output.
  void (*distance_opacity)(const RaySpan* spans, int ray_count, float sharpness, SampleChunk& chunk);
  void (*distance_backward)(const RaySpan* spans, int ray_count, float sharpness, SampleChunk& chunk);

  // Renders rays and their adjoint (see math/composite.h): weight, behind and d_raw of the chunk's samples, and
  // `results`, one per ray; rays without samples keep theirs. A ray whose partner is not among them, or has no samples,
  // has none.
  void (*composite)(const Ray* rays, const RaySpan* spans, int ray_count, const LossWeights& weights,
                    SampleChunk& chunk, RayResult* results);

  // Moves the samples whose |d_raw| sums to more than `cut` to the front, in their order: x, y, z, features, hidden and
  // d_raw, this multiplied by `scale`. Returns how many they are; the arrays behind them are left in no order.
  int (*keep_active)(float cut, float scale, int features, int hidden, SampleChunk& chunk);

  // Sums `gradient_count` gradient arrays, zeroes them, and updates parameters [begin, end), multiples of kMaxLanes.
  void (*adam)(const AdamRates& rates, size_t begin, size_t end, float* parameters, float* first, float* second,
               float* const* gradients, int gradient_count);

  // The same for every encoding and depth of MLP; null where this is that table. `hidden` of its MLP kernels is unused.
  const KernelTable* general = nullptr;

  // The table that can run `model`.
  const KernelTable& For(const FieldModel& model) const { return model.NeedsGeneralKernels() ? *general : *this; }
};

const KernelTable& PlainKernels();
// The best instruction set of this machine (Highway's dynamic dispatch).
const KernelTable& SimdKernels();

}  // namespace romap::nerf
