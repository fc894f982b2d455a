// Kernels that compute the gradients of a batch of rays in one launch, and evaluate a field at given points.

#include "server/nerf/cuda/field_kernels.h"
#include "server/nerf/cuda/float_mlp.cuh"
#include "server/nerf/cuda/tensor_mlp.cuh"
#include "server/nerf/cuda/tile.cuh"
#include "server/nerf/math/activation.h"
#include "server/nerf/math/composite.h"
#include "server/nerf/math/losses.h"
#include "server/nerf/math/sampling.h"

namespace romap::nerf::cuda {
namespace {

// Largest derivative of a tile after scaling: far below 65504, the largest half, because products are summed.
constexpr float kLargestScaled = 16.0f;

// The rays of one tile.
struct TileRays {
  const Ray* rays;
  float* color_loss;
  int count;
};

// Number of the set bit of `bits` that has `n` set bits below it; there must be more than n set bits.
__device__ int NumberOfSetBit(uint64_t bits, int n) {
  int number = 0;
  for (int width = 32; width > 0; width /= 2) {
    const uint64_t low = bits & ((uint64_t{1} << width) - 1);
    const int in_low = __popcll(low);
    if (n < in_low) {
      bits = low;
    } else {
      n -= in_low;
      bits >>= width;
      number += width;
    }
  }
  return number;
}

// Computes the segments of the rays. One warp per ray, each lane tests two pieces.
template <class T>
__device__ void FindSegments(const StepParams& p, const TileRays& in, Tile<T>& tile) {
  const int lane = threadIdx.x % kWarpThreads;
  const float* extent = p.slice->extent;
  for (int r = threadIdx.x / kWarpThreads; r < in.count; r += kTileWarps) {
    const Ray& ray = in.rays[r];
    RaySegment segment{0.0f, 0.0f, 0.0f, 0, 0};
    float exit;
    if (plain::IntersectBox(ray.origin, ray.direction, extent, segment.entry, exit)) {
      segment.piece = (exit - segment.entry) / kRayProbes;
      const plain::RayInCells<float> in_cells(ray, extent);
      for (int half = 0; half < kRayProbes / kWarpThreads; ++half) {
        const float number = static_cast<float>(half * kWarpThreads + lane);
        const uint32_t cell = in_cells.CellAt(plain::PieceCenter(number, segment.piece, segment.entry));
        const int occupied = !p.budget.skip_empty || (p.occupied_bits[cell / 32] >> (cell % 32) & 1) != 0;
        segment.occupied |= static_cast<uint64_t>(__ballot_sync(kWholeWarp, occupied)) << (half * kWarpThreads);
      }
      const float pieces = static_cast<float>(__popcll(segment.occupied));
      segment.count = SampleCount(p.budget, segment.piece * pieces);
      if (segment.count > 0) segment.length = segment.piece * (pieces / static_cast<float>(segment.count));
    }
    if (lane == 0) tile.segments[r] = segment;
  }
}

// t of sample `i` of a segment. `jitter`: 0..1, position of the sample within its stratum.
__device__ float SamplePosition(const RaySegment& segment, int i, float jitter) {
  const int pieces = __popcll(segment.occupied);
  const float at = (static_cast<float>(i) + jitter) * (static_cast<float>(pieces) / static_cast<float>(segment.count));
  const float joined = plain::JoinedPieceAt(at, static_cast<float>(pieces - 1));
  const int number = NumberOfSetBit(segment.occupied, static_cast<int>(joined));
  return plain::PositionOnRay(static_cast<float>(number) + (at - joined), segment.piece, segment.entry);
}

// Computes position, cell and features of the calling thread's sample; the features are 0 if it has no sample. Returns
// the cell, or kCells without a sample.
template <class T>
__device__ uint32_t PlaceSample(const StepParams& p, const TileRays& in, Tile<T>& tile) {
  const int s = threadIdx.x, r = s / tile.samples_per_ray, i = s % tile.samples_per_ray;
  T* feature = tile.feature + s * tile.feature_row;
  const bool used = r < in.count && i < tile.segments[r].count;
  const GridLayout& grid = p.field.grid;
  for (int f = used ? kFeaturesPerLevel * grid.levels : 0; f < grid.features; ++f) feature[f] = T(0.0f);
  if (!used) return kCells;
  const Ray& ray = in.rays[r];
  const RaySegment segment = tile.segments[r];
  const float* extent = p.slice->extent;
  const float t = SamplePosition(segment, i, ray.jitter);
  float at[3];
  for (int a = 0; a < 3; ++a) at[a] = plain::SampleCoordinate(ray.origin[a], ray.direction[a], t, extent[a]);
  plain::MoveToGrid(p.slice->grid, at[0], at[1], at[2]);
  tile.x[s] = at[0];
  tile.y[s] = at[1];
  tile.z[s] = at[2];
  tile.t[s] = t;
  tile.length[s] = segment.length;
  for (int level = 0; level < grid.levels; ++level) {
    float value[kFeaturesPerLevel];
    EncodeLevel(grid, p.field.table, level, at[0], at[1], at[2], value);
    for (int f = 0; f < kFeaturesPerLevel; ++f) feature[kFeaturesPerLevel * level + f] = Rounded<T>(value[f]);
  }
  return plain::RayInCells<float>(ray, extent).CellAt(t);
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

// Renders the calling thread's ray and replaces tile.raw by the derivatives of its loss. Must be called by whole warps,
// because partners exchange their color errors.
template <class T>
__device__ void RenderRay(const StepParams& p, const TileRays& in, Tile<T>& tile) {
  const int r = threadIdx.x;
  const int count = r < in.count ? tile.segments[r].count : 0;
  if (r < in.count) in.color_loss[r] = -1.0f;
  const int at = r * tile.samples_per_ray;
  const RaySamples ray{count,           tile.t + at,       tile.length + at,
                       tile.alpha + at, tile.density + at, {tile.red + at, tile.green + at, tile.blue + at}};
  RayTarget target{};
  RayResult result{};
  float error[3] = {}, partner_error[3];
  if (count > 0) {
    target = in.rays[r].target;
    result = plain::CompositeForward(ray, target.depth, tile.weight + at, tile.behind + at);
    plain::ColorError(result, target, p.loss_weights, error);
  }
  // A ray with an even index and the next one are partners or have none, and belong to the same warp.
  const bool partner_has_samples = __shfl_xor_sync(kWholeWarp, count, 1) > 0;
  for (int c = 0; c < 3; ++c) partner_error[c] = __shfl_xor_sync(kWholeWarp, error[c], 1);
  if (count == 0) return;
  const bool has_partner = target.partner != 0 && partner_has_samples;
  const RayLoss loss = plain::LossOfRay(result, target, p.loss_weights, has_partner, partner_error);
  if (target.is_object) in.color_loss[r] = loss.color;
  plain::CompositeBackward(ray, target.depth, loss, tile.weight + at, tile.behind + at, tile.raw + kOutputs * at);
  atomicAdd(&p.counters->rays, 1ull);
  atomicAdd(&p.counters->samples, static_cast<unsigned long long>(count));
}

// Records the calling thread's sample for the occupancy.
template <class T>
__device__ void RecordVisit(const StepParams& p, uint32_t cell, Tile<T>& tile) {
  const float weight = tile.weight[threadIdx.x];
  atomicAdd(p.cell_visits + cell, 1u);
  if (!(weight > 0.0f)) return;  // also excludes NaN
  atomicMax(p.cell_weight + cell, __float_as_uint(weight));
  const uint32_t units = static_cast<uint32_t>(weight * (1.0f / kLayerUnit));
  constexpr uint32_t kSide = kOccupancyResolution;
  atomicAdd(tile.layer_weight + cell % kSide, units);
  atomicAdd(tile.layer_weight + kSide + cell / kSide % kSide, units);
  atomicAdd(tile.layer_weight + 2 * kSide + cell / (kSide * kSide), units);
}

// Sets small derivatives of the calling thread's sample to 0, scales the others, and returns the largest.
template <class T>
__device__ float FilterDerivatives(const StepParams& p, bool used, Tile<T>& tile) {
  float* d_raw = tile.raw + threadIdx.x * kOutputs;
  const float size = used ? plain::GradientSize(d_raw[0], d_raw[1], d_raw[2], d_raw[3]) : 0.0f;
  // The negated comparison lets NaN pass, so that it reaches the parameters and is detected there.
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

// The power of two that scales the largest derivative of the block to just below kLargestScaled. Must be called between
// barriers by all threads. `active`, out: number of active samples of the block.
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
__device__ void ProcessTile(const StepParams& p, const TileRays& in, Tile<typename Mlp::Factor>& tile) {
  FindSegments(p, in, tile);
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
  const float largest = FilterDerivatives(p, used, tile);
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
  LayOutTile(p.field, p.budget.max_samples, memory, tile);
  const uint32_t step = p.slice->next;
  if (blockIdx.x == 0 && threadIdx.x == 0) p.slice->running = step;
  Mlp::Prepare(p.field, tile);
  for (int i = threadIdx.x; i < tile.WeightGradients(); i += kTileSamples) tile.weight_gradient[i] = 0.0f;
  for (int i = threadIdx.x; i < kLayers; i += kTileSamples) tile.layer_weight[i] = 0;
  __syncthreads();
  const size_t begin = static_cast<size_t>(step) * p.rays_per_step;
  for (int first = blockIdx.x * tile.ray_slots; first < p.rays_per_step; first += gridDim.x * tile.ray_slots) {
    const int left = p.rays_per_step - first;
    ProcessTile<Mlp>(
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

// One block per tile of points.
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
  return LayOutTile<T>(field, budget.max_samples, nullptr, tile);
}

template <class T>
size_t EvaluateBytes(const DeviceField& field) {
  Tile<T> tile;
  Arena arena(nullptr);
  LayOutMlp(field, arena, tile);
  return arena.bytes();
}

bool IsSupported(const DeviceField& field) {
  return field.hidden <= kMaxHidden && field.hidden % kEdge == 0 && field.grid.features <= kMaxFeatures &&
         field.grid.features % kEdge == 0;
}

template <class Kernel>
cudaError_t AllowShared(Kernel kernel, size_t bytes) {
  return cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, static_cast<int>(bytes));
}

}  // namespace

cudaError_t LaunchEvaluate(const EvaluateParams& params, MlpPath path, cudaStream_t stream) {
  if (!IsSupported(params.field)) return cudaErrorInvalidValue;
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

int StepBlocks(int rays_per_step, int max_samples) {
  const int rays_per_tile = RaysThatFit(kTileSamples, max_samples);
  const int tiles = (rays_per_step + rays_per_tile - 1) / rays_per_tile;
  return tiles < kMaxStepBlocks ? tiles : kMaxStepBlocks;
}

size_t StepSharedBytes(const DeviceField& field, const SampleBudget& budget, MlpPath path) {
  return path == MlpPath::kTensorCores ? StepBytes<__half>(field, budget) : StepBytes<float>(field, budget);
}

cudaError_t PrepareStep(const StepParams& params, MlpPath path) {
  if (!IsSupported(params.field)) return cudaErrorInvalidValue;
  const size_t bytes = StepSharedBytes(params.field, params.budget, path);
  return path == MlpPath::kTensorCores ? AllowShared(StepKernel<TensorMlp>, bytes)
                                       : AllowShared(StepKernel<FloatMlp>, bytes);
}

cudaError_t LaunchGradients(const StepParams& params, MlpPath path, cudaStream_t stream) {
  const dim3 grid(static_cast<unsigned>(StepBlocks(params.rays_per_step, params.budget.max_samples))),
      block(kTileSamples);
  const size_t bytes = StepSharedBytes(params.field, params.budget, path);
  if (path == MlpPath::kTensorCores) {
    ROMAP_LAUNCH(StepKernel<TensorMlp>, grid, block, bytes, stream, params);
  } else {
    ROMAP_LAUNCH(StepKernel<FloatMlp>, grid, block, bytes, stream, params);
  }
  return cudaGetLastError();
}

}  // namespace romap::nerf::cuda
