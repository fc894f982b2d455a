// Gradients to parameters, samples' weights to occupied cells.

#include "server/nerf/cuda/field_kernels.h"
#include "server/nerf/math/adam.h"
#include "server/nerf/math/occupancy.h"

namespace romap::nerf::cuda {
namespace {

constexpr unsigned kBlockThreads = 128;
constexpr int kCellsOfThread = 4;
constexpr int kRowWords = kOccupancyResolution / 32;
static_assert(kOccupancyResolution == 64, "a row of cells must be one 64-bit word");

unsigned BlocksFor(size_t threads) { return static_cast<unsigned>((threads + kBlockThreads - 1) / kBlockThreads); }

__device__ bool UpdateIsDue(const OccupancyPlan& plan, const SliceState& slice) {
  const uint64_t done = slice.first_step + slice.running + 1;
  return done >= plan.start && done % plan.interval == 0;
}

// One entry of the table.
__device__ void OptimiseTable(const OptimiseParams& p, const AdamRates& rates, size_t i) {
  if (i >= p.table_count) return;
  const float gradient = p.table_gradient[i];
  if (gradient == 0.0f) return;  // most entries of the fine levels, at any one step
  p.table_gradient[i] = 0.0f;
  plain::AdamUpdate(gradient, rates, p.table[i], p.table_first[i], p.table_second[i]);
}

// One weight of the MLP; a warp adds up what the blocks found.
__device__ void OptimiseWeight(const OptimiseParams& p, const AdamRates& rates, int w) {
  if (w >= p.mlp_count) return;
  const int lane = threadIdx.x % kWarpThreads;
  const float* partial = p.mlp_partial + static_cast<size_t>(w) * p.step_blocks;
  float gradient = 0.0f;
  for (int b = lane; b < p.step_blocks; b += kWarpThreads) gradient += partial[b];
  for (int delta = kWarpThreads / 2; delta > 0; delta /= 2) gradient += __shfl_xor_sync(kWholeWarp, gradient, delta);
  if (lane == 0 && gradient != 0.0f) {
    plain::AdamUpdate(gradient, rates, p.mlp[w], p.mlp_first[w], p.mlp_second[w]);
  }
}

// kCellsOfThread neighbouring cells of the occupancy; eight threads make a word of live cells.
__device__ void ScoreCells(const OptimiseParams& p, uint32_t first) {
  const uint4 visits = *reinterpret_cast<const uint4*>(p.cell_visits + first);
  if ((visits.x | visits.y | visits.z | visits.w) != 0) {
    const uint32_t visits_of[kCellsOfThread] = {visits.x, visits.y, visits.z, visits.w};
    for (int i = 0; i < kCellsOfThread; ++i) {
      if (visits_of[i] == 0) continue;
      float& score = p.score[first + i];
      score = CellScore(score, __uint_as_float(p.cell_weight[first + i]), visits_of[i], p.decay);
      p.cell_visits[first + i] = 0;
      p.cell_weight[first + i] = 0;
    }
  }
  if (!UpdateIsDue(p.plan, *p.slice)) return;
  const uint32_t bit = first % 32;
  uint32_t live = 0;
  for (int i = 0; i < kCellsOfThread; ++i) live |= static_cast<uint32_t>(p.score[first + i] > p.threshold) << (bit + i);
  for (int delta = 1; delta < 32 / kCellsOfThread; delta *= 2) live |= __shfl_xor_sync(kWholeWarp, live, delta);
  if (bit == 0) p.live_bits[first / 32] = live & p.hull_bits[first / 32];
}

// Blocks of three kinds: for the table, for the MLP, for the cells.
__global__ void __launch_bounds__(kBlockThreads)
    OptimiseKernel(OptimiseParams p, unsigned table_blocks, unsigned mlp_blocks) {
  const AdamRates rates{p.learning_rate[p.slice->running], p.beta1, p.beta2};
  if (blockIdx.x < table_blocks) {
    OptimiseTable(p, rates, static_cast<size_t>(blockIdx.x) * kBlockThreads + threadIdx.x);
  } else if (blockIdx.x < table_blocks + mlp_blocks) {
    const unsigned thread = (blockIdx.x - table_blocks) * kBlockThreads + threadIdx.x;
    OptimiseWeight(p, rates, static_cast<int>(thread / kWarpThreads));
  } else {
    ScoreCells(p, ((blockIdx.x - table_blocks - mlp_blocks) * kBlockThreads + threadIdx.x) * kCellsOfThread);
  }
}

__device__ uint64_t RowOf(const uint32_t* bits, int row) {
  return bits[kRowWords * row] | static_cast<uint64_t>(bits[kRowWords * row + 1]) << 32;
}

// One row of cells: those of the hull that are live or have a live neighbour.
__global__ void __launch_bounds__(kBlockThreads) OccupancyKernel(OccupancyParams p) {
  const int row = static_cast<int>(blockIdx.x * kBlockThreads + threadIdx.x);
  if (row == 0) p.slice->next = p.slice->running + 1;
  if (!UpdateIsDue(p.plan, *p.slice)) return;
  if (row < kLayers) p.layer_weight[row] /= 2;  // early steps end rays all over the hull
  const int y = row % kOccupancyResolution, z = row / kOccupancyResolution;
  uint64_t live = 0;
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      const bool inside = y + dy >= 0 && y + dy < kOccupancyResolution && z + dz >= 0 && z + dz < kOccupancyResolution;
      if (inside) live |= RowOf(p.live_bits, row + dz * kOccupancyResolution + dy);
    }
  }
  const uint64_t occupied = (live | live << 1 | live >> 1) & RowOf(p.hull_bits, row);
  p.occupied_bits[kRowWords * row] = static_cast<uint32_t>(occupied);
  p.occupied_bits[kRowWords * row + 1] = static_cast<uint32_t>(occupied >> 32);
}

}  // namespace

cudaError_t LaunchStep(const StepLaunch& launch, MlpPath path, cudaStream_t stream) {
  const cudaError_t error = LaunchGradients(launch.step, path, stream);
  return error != cudaSuccess ? error : LaunchOptimise(launch, stream);
}

cudaError_t LaunchOptimise(const StepLaunch& launch, cudaStream_t stream) {
  const unsigned table_blocks = BlocksFor(launch.optimise.table_count);
  const unsigned mlp_blocks = BlocksFor(static_cast<size_t>(launch.optimise.mlp_count) * kWarpThreads);
  ROMAP_LAUNCH(OptimiseKernel, dim3(table_blocks + mlp_blocks + BlocksFor(kCells / kCellsOfThread)),
               dim3(kBlockThreads), 0, stream, launch.optimise, table_blocks, mlp_blocks);
  ROMAP_LAUNCH(OccupancyKernel, dim3(BlocksFor(kOccupancyResolution * kOccupancyResolution)), dim3(kBlockThreads), 0,
               stream, launch.occupancy);
  return cudaGetLastError();
}

}  // namespace romap::nerf::cuda
