// Rays to gradients in one launch, and the field's values at given points.

#include "server/nerf/cuda/field_kernels.h"
#include "server/nerf/cuda/float_mlp.cuh"
#include "server/nerf/cuda/tensor_mlp.cuh"
#include "server/nerf/cuda/tile.cuh"
#include "server/nerf/math/activation.h"
#include "server/nerf/math/composite.h"

namespace romap::nerf::cuda {
namespace {

constexpr float kLargestScaled = 16.0f;  // of a tile's derivatives as halves: far from 65504, for sums of products

// The rays of one tile.
struct TileRays {
  const Ray* rays;
  float* color_loss;
  int count;
};

// A ray's way through the box; a warp works on one ray, its lanes on two probes each.
template <class T>
__device__ void FindWays(const StepParams& p, const TileRays& in, Tile<T>& tile) {
  const int lane = threadIdx.x % kWarpThreads;
  const float* extent = p.slice->extent;
  for (int r = threadIdx.x / kWarpThreads; r < in.count; r += kTileWarps) {
    const Ray& ray = in.rays[r];
    RayWay way{0.0f, 0.0f, 0.0f, 0, 0};
    float exit;
    if (plain::IntersectBox(ray.origin, ray.direction, extent, way.entry, exit)) {
      way.piece = (exit - way.entry) / kRayProbes;
      for (int half = 0; half < kRayProbes / kWarpThreads; ++half) {
        const int probe = half * kWarpThreads + lane;
        const uint32_t cell = CellOnRay(ray, extent, ProbePlace(probe, way.piece, way.entry));
        const int occupied = !p.budget.skip_empty || (p.occupied_bits[cell / 32] >> (cell % 32) & 1) != 0;
        way.occupied |= static_cast<uint64_t>(__ballot_sync(kWholeWarp, occupied)) << (half * kWarpThreads);
      }
      const float pieces = static_cast<float>(CountBits(way.occupied));
      way.count = SampleCount(p.budget, way.piece * pieces);
      if (way.count > 0) way.length = way.piece * (pieces / static_cast<float>(way.count));
    }
    if (lane == 0) tile.ways[r] = way;
  }
}

// Position, cell and features of the calling thread's sample; its features are 0 if it has none. Returns the cell, or
// kCells without a sample.
template <class T>
__device__ uint32_t PlaceSample(const StepParams& p, const TileRays& in, Tile<T>& tile) {
  const int s = threadIdx.x, r = s / tile.samples_per_ray, i = s % tile.samples_per_ray;
  T* feature = tile.feature + s * tile.feature_row;
  const bool used = r < in.count && i < tile.ways[r].count;
  const GridLayout& grid = p.field.grid;
  for (int f = used ? kFeaturesPerLevel * grid.levels : 0; f < grid.features; ++f) feature[f] = T(0.0f);
  if (!used) return kCells;
  const Ray& ray = in.rays[r];
  const RayWay way = tile.ways[r];
  const float* extent = p.slice->extent;
  const float t = SamplePlace(i, way.count, ray.jitter, way.occupied, way.piece, way.entry);
  float at[3];
  for (int a = 0; a < 3; ++a) {
    // Rounding may put a point a hair outside the box; the encoding wants it inside.
    at[a] = plain::Min(plain::Max(RayPoint(ray, a, t), 0.0f), extent[a]);
  }
  plain::MoveToGrid(p.slice->grid, at[0], at[1], at[2]);
  tile.x[s] = at[0];
  tile.y[s] = at[1];
  tile.z[s] = at[2];
  tile.t[s] = t;
  tile.length[s] = way.length;
  for (int level = 0; level < grid.levels; ++level) {
    float value[kFeaturesPerLevel];
    EncodeLevel(grid, p.field.table, level, at[0], at[1], at[2], value);
    for (int f = 0; f < kFeaturesPerLevel; ++f) feature[kFeaturesPerLevel * level + f] = Rounded<T>(value[f]);
  }
  return CellOnRay(ray, extent, t);
}

template <class T>
__device__ void Activate(const DeviceField& field, Tile<T>& tile) {
  const int s = threadIdx.x;
  const float* raw = tile.raw + s * kOutputs;
  tile.red[s] = plain::Sigmoid(raw[0]);
  tile.green[s] = plain::Sigmoid(raw[1]);
  tile.blue[s] = plain::Sigmoid(raw[2]);
  tile.density[s] = plain::Density(raw[3] + field.density_bias);
  tile.alpha[s] = plain::StepOpacity(tile.density[s], tile.length[s]);
}

// Renders the calling thread's ray and turns tile.raw into the derivatives of its loss. To be called by whole warps:
// partners exchange their errors.
template <class T>
__device__ void RenderRay(const StepParams& p, const TileRays& in, Tile<T>& tile) {
  const int r = threadIdx.x;
  const int count = r < in.count ? tile.ways[r].count : 0;
  if (r < in.count) in.color_loss[r] = -1.0f;
  const int at = r * tile.samples_per_ray;
  const RaySamples ray{count,           tile.t + at,       tile.length + at,
                       tile.alpha + at, tile.density + at, {tile.red + at, tile.green + at, tile.blue + at}};
  RayTarget target{};
  RayResult result{};
  float error[3] = {}, partner_error[3];
  if (count > 0) {
    target = in.rays[r].target;
    result = plain::CompositeForward(ray, target, p.loss_weights, tile.weight + at, tile.behind + at);
    plain::ColorError(result, target, p.loss_weights, error);
  }
  // A ray at an even place and the one behind it are partners or have none, and lie in one warp.
  const bool partner_seen = __shfl_xor_sync(kWholeWarp, count, 1) > 0;
  for (int c = 0; c < 3; ++c) partner_error[c] = __shfl_xor_sync(kWholeWarp, error[c], 1);
  if (count == 0) return;
  if (target.is_object) in.color_loss[r] = result.color_loss;
  if (target.partner != 0 && partner_seen) {
    target = plain::ContrastTarget(target, p.loss_weights, error, partner_error, result);
  }
  plain::CompositeBackward(ray, target, p.loss_weights, result, tile.weight + at, tile.behind + at,
                           tile.raw + kOutputs * at);
  atomicAdd(&p.counters->rays, 1ull);
  atomicAdd(&p.counters->samples, static_cast<unsigned long long>(count));
}

// Tells the occupancy of the calling thread's sample.
template <class T>
__device__ void RecordVisit(const StepParams& p, uint32_t cell, Tile<T>& tile) {
  const float weight = tile.weight[threadIdx.x];
  atomicAdd(p.cell_visits + cell, 1u);
  if (!(weight > 0.0f)) return;  // nor what is not a number
  atomicMax(p.cell_weight + cell, __float_as_uint(weight));
  const uint32_t units = static_cast<uint32_t>(weight * (1.0f / kLayerUnit));
  constexpr uint32_t kSide = kOccupancyResolution;
  atomicAdd(tile.layer_weight + cell % kSide, units);
  atomicAdd(tile.layer_weight + kSide + cell / kSide % kSide, units);
  atomicAdd(tile.layer_weight + 2 * kSide + cell / (kSide * kSide), units);
}

// Cuts off or scales the derivatives of the calling thread's sample; the largest of them, 0 without any.
template <class T>
__device__ float CutDerivatives(const StepParams& p, bool used, Tile<T>& tile) {
  float* d_raw = tile.raw + threadIdx.x * kOutputs;
  float size = 0.0f;
  for (int o = 0; o < kOutputs && used; ++o) size += std::fabs(d_raw[o]);
  // Written so that what is not a number passes.
  const bool active = used && !(size <= p.gradient_cut);
  tile.active[threadIdx.x] = active;
  const float scale = 1.0f / static_cast<float>(p.rays_per_step);
  float largest = 0.0f;
  for (int o = 0; o < kOutputs; ++o) {
    d_raw[o] = active ? d_raw[o] * scale : 0.0f;
    largest = plain::Max(std::fabs(d_raw[o]), largest);
  }
  return largest;
}

// The power of two that brings the largest derivative of the block just below kLargestScaled. To be called between
// barriers by all threads; `active` gets the number of samples that have one.
template <class T>
__device__ float DerivativeScale(float largest, Tile<T>& tile, int& active) {
  for (int delta = kWarpThreads / 2; delta > 0; delta /= 2) {
    largest = plain::Max(__shfl_xor_sync(kWholeWarp, largest, delta), largest);
  }
  if (threadIdx.x % kWarpThreads == 0) tile.warp_largest[threadIdx.x / kWarpThreads] = largest;
  active = __syncthreads_count(tile.active[threadIdx.x]);
  for (int warp = 0; warp < kTileWarps; ++warp) largest = plain::Max(tile.warp_largest[warp], largest);
  int exponent = 0;
  std::frexp(largest / kLargestScaled, &exponent);
  return std::ldexp(1.0f, -exponent);
}

template <class Mlp>
__device__ void WorkOnTile(const StepParams& p, const TileRays& in, Tile<typename Mlp::Factor>& tile) {
  FindWays(p, in, tile);
  __syncthreads();
  const uint32_t cell = PlaceSample(p, in, tile);
  const bool used = cell < kCells;
  __syncwarp();
  Mlp::Forward(p.field, tile);
  __syncwarp();
  if (used) Activate(p.field, tile);
  __syncthreads();
  if (static_cast<int>(threadIdx.x) / kWarpThreads * kWarpThreads < in.count) RenderRay(p, in, tile);
  __syncthreads();
  if (used) RecordVisit(p, cell, tile);
  const float largest = CutDerivatives(p, used, tile);
  int active = 0;
  const float scale = DerivativeScale(largest, tile, active);
  if (active == 0) return;
  if (threadIdx.x == 0) atomicAdd(&p.counters->active_samples, static_cast<unsigned long long>(active));
  Mlp::Backward(p.field, tile, scale, p.table_gradient);
}

template <class Mlp>
__global__ void __launch_bounds__(kTileSamples, 4) StepKernel(StepParams p) {
  ROMAP_DYNAMIC_SHARED(unsigned char, memory);
  Tile<typename Mlp::Factor> tile;
  LayOutTile(p.field, p.budget.most, memory, tile);
  const uint32_t step = p.slice->next;
  if (blockIdx.x == 0 && threadIdx.x == 0) p.slice->running = step;
  Mlp::Prepare(p.field, tile);
  for (int i = threadIdx.x; i < tile.WeightGradients(); i += kTileSamples) tile.weight_gradient[i] = 0.0f;
  for (int i = threadIdx.x; i < kLayers; i += kTileSamples) tile.layer_weight[i] = 0;
  __syncthreads();
  const size_t begin = static_cast<size_t>(step) * p.rays_per_step;
  for (int first = blockIdx.x * tile.ray_slots; first < p.rays_per_step; first += gridDim.x * tile.ray_slots) {
    const int left = p.rays_per_step - first;
    WorkOnTile<Mlp>(
        p, {p.rays + begin + first, p.color_loss + begin + first, left < tile.ray_slots ? left : tile.ray_slots}, tile);
  }
  __syncthreads();
  for (int i = threadIdx.x; i < (tile.features + kOutputs) * tile.hidden; i += kTileSamples) {
    p.mlp_partial[static_cast<size_t>(i) * gridDim.x + blockIdx.x] = tile.weight_gradient[i];
  }
  for (int i = threadIdx.x; i < kLayers; i += kTileSamples) {
    if (tile.layer_weight[i] > 0) {
      atomicAdd(p.layer_weight + i, static_cast<unsigned long long>(tile.layer_weight[i]));
    }
  }
}

// A block per tile of points.
template <class Mlp>
__global__ void __launch_bounds__(kTileSamples, 4) EvaluateKernel(EvaluateParams p) {
  using T = typename Mlp::Factor;
  ROMAP_DYNAMIC_SHARED(unsigned char, memory);
  Tile<T> tile;
  Arena arena(memory);
  LayOutMlp(p.field, arena, tile);
  Mlp::Prepare(p.field, tile);
  __syncthreads();
  const size_t i = static_cast<size_t>(blockIdx.x) * kTileSamples + threadIdx.x;
  const bool used = i < static_cast<size_t>(p.count);
  const GridLayout& grid = p.field.grid;
  T* feature = tile.feature + threadIdx.x * tile.feature_row;
  for (int f = used ? kFeaturesPerLevel * grid.levels : 0; f < grid.features; ++f) feature[f] = T(0.0f);
  for (int level = 0; level < grid.levels && used; ++level) {
    float value[kFeaturesPerLevel];
    EncodeLevel(grid, p.field.table, level, p.x[i], p.y[i], p.z[i], value);
    for (int f = 0; f < kFeaturesPerLevel; ++f) feature[kFeaturesPerLevel * level + f] = Rounded<T>(value[f]);
  }
  __syncwarp();
  Mlp::Forward(p.field, tile);
  __syncwarp();
  if (!used) return;
  const float* raw = tile.raw + threadIdx.x * kOutputs;
  for (int c = 0; c < 3; ++c) p.value[kOutputs * i + c] = plain::Sigmoid(raw[c]);
  p.value[kOutputs * i + 3] = raw[3] + p.field.density_bias;
}

template <class T>
size_t StepBytes(const DeviceField& field, const SampleBudget& budget) {
  Tile<T> tile;
  return LayOutTile<T>(field, budget.most, nullptr, tile);
}

template <class T>
size_t EvaluateBytes(const DeviceField& field) {
  Tile<T> tile;
  Arena arena(nullptr);
  LayOutMlp(field, arena, tile);
  return arena.bytes();
}

bool Fits(const DeviceField& field) {
  return field.hidden <= kMaxHidden && field.hidden % kEdge == 0 && field.grid.features <= kMaxFeatures &&
         field.grid.features % kEdge == 0;
}

template <class Kernel>
cudaError_t AllowShared(Kernel kernel, size_t bytes) {
  return cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes));
}

}  // namespace

cudaError_t LaunchEvaluate(const EvaluateParams& params, MlpPath path, cudaStream_t stream) {
  if (!Fits(params.field)) return cudaErrorInvalidValue;
  if (params.count == 0) return cudaSuccess;
  const dim3 grid(static_cast<unsigned>((params.count + kTileSamples - 1) / kTileSamples)), block(kTileSamples);
  const bool tensor = path == MlpPath::kTensorCores;
  const size_t bytes = tensor ? EvaluateBytes<__half>(params.field) : EvaluateBytes<float>(params.field);
  const cudaError_t error =
      tensor ? AllowShared(EvaluateKernel<TensorMlp>, bytes) : AllowShared(EvaluateKernel<FloatMlp>, bytes);
  if (error != cudaSuccess) return error;
  if (tensor) {
    ROMAP_LAUNCH(EvaluateKernel<TensorMlp>, grid, block, bytes, stream, params);
  } else {
    ROMAP_LAUNCH(EvaluateKernel<FloatMlp>, grid, block, bytes, stream, params);
  }
  return cudaGetLastError();
}

int StepBlocks(int rays_per_step, int most_samples) {
  const int rays_per_tile = RaySlots(most_samples);
  const int tiles = (rays_per_step + rays_per_tile - 1) / rays_per_tile;
  return tiles < kMaxStepBlocks ? tiles : kMaxStepBlocks;
}

size_t StepSharedBytes(const DeviceField& field, const SampleBudget& budget, MlpPath path) {
  return path == MlpPath::kTensorCores ? StepBytes<__half>(field, budget) : StepBytes<float>(field, budget);
}

cudaError_t PrepareStep(const StepParams& params, MlpPath path) {
  if (!Fits(params.field)) return cudaErrorInvalidValue;
  const size_t bytes = StepSharedBytes(params.field, params.budget, path);
  return path == MlpPath::kTensorCores ? AllowShared(StepKernel<TensorMlp>, bytes)
                                       : AllowShared(StepKernel<FloatMlp>, bytes);
}

cudaError_t LaunchGradients(const StepParams& params, MlpPath path, cudaStream_t stream) {
  const dim3 grid(static_cast<unsigned>(StepBlocks(params.rays_per_step, params.budget.most))), block(kTileSamples);
  const size_t bytes = StepSharedBytes(params.field, params.budget, path);
  if (path == MlpPath::kTensorCores) {
    ROMAP_LAUNCH(StepKernel<TensorMlp>, grid, block, bytes, stream, params);
  } else {
    ROMAP_LAUNCH(StepKernel<FloatMlp>, grid, block, bytes, stream, params);
  }
  return cudaGetLastError();
}

}  // namespace romap::nerf::cuda
