// Kernels that update the parameters from the gradients, and the occupied cells from the weights of the samples.

#include "server/nerf/cuda/field_kernels.h"
#include "server/nerf/math/adam.h"
#include "server/nerf/math/occupancy_rules.h"

namespace romap::nerf::cuda {
namespace {

constexpr unsigned kBlockThreads = 128;
constexpr int kCellsPerThread = 4;
constexpr int kRowWords = kOccupancyResolution / 32;
static_assert(kOccupancyResolution == 64, "a row of cells must be one 64-bit word");

unsigned BlocksFor(size_t threads) { return static_cast<unsigned>((threads + kBlockThreads - 1) / kBlockThreads); }

__device__ bool UpdateIsDue(const OccupancyPlan& plan, const SliceState& slice) {
  return OccupancyUpdateIsDue(plan, slice.first_step + slice.running + 1);
}

// One entry of the table.
__device__ void OptimizeTable(const OptimizeParams& p, const AdamRates& rates, size_t i) {
  if (i >= p.table_count) return;
  const float gradient = p.table_gradient[i];
  if (gradient == 0.0f) return;  // true for most entries of the fine levels in any one step
  p.table_gradient[i] = 0.0f;
  plain::AdamUpdate(gradient, rates, p.table[i], p.table_first[i], p.table_second[i]);
}

// One weight of the MLP; a warp sums the partial gradients of the blocks.
__device__ void OptimizeWeight(const OptimizeParams& p, const AdamRates& rates, int w) {
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

// kCellsPerThread consecutive cells of the occupancy; eight threads form a word of live cells.
__device__ void ScoreCells(const OptimizeParams& p, uint32_t first) {
  const uint4 visits = *reinterpret_cast<const uint4*>(p.cell_visits + first);
  if ((visits.x | visits.y | visits.z | visits.w) != 0) {
    const uint32_t visits_of[kCellsPerThread] = {visits.x, visits.y, visits.z, visits.w};
    for (int i = 0; i < kCellsPerThread; ++i) {
      if (visits_of[i] == 0) continue;
      float& score = p.score[first + i];
      score = ScoreAfterVisits(score, __uint_as_float(p.cell_weight[first + i]), visits_of[i], p.decay);
      p.cell_visits[first + i] = 0;
      p.cell_weight[first + i] = 0;
    }
  }
  if (!UpdateIsDue(p.plan, *p.slice)) return;
  const uint32_t bit = first % 32;
  uint32_t live = 0;
  for (int i = 0; i < kCellsPerThread; ++i)
    live |= static_cast<uint32_t>(IsLive(p.score[first + i], p.threshold)) << (bit + i);
  for (int delta = 1; delta < 32 / kCellsPerThread; delta *= 2) live |= __shfl_xor_sync(kWholeWarp, live, delta);
  if (bit == 0) p.live_bits[first / 32] = live & p.hull_bits[first / 32];
}

// The first blocks update the table, the next ones the MLP, the last ones the cells.
__global__ void __launch_bounds__(kBlockThreads)
    OptimizeKernel(OptimizeParams p, unsigned table_blocks, unsigned mlp_blocks) {
  const AdamRates rates{p.learning_rate[p.slice->running], p.beta1, p.beta2};
  if (blockIdx.x < table_blocks) {
    OptimizeTable(p, rates, static_cast<size_t>(blockIdx.x) * kBlockThreads + threadIdx.x);
  } else if (blockIdx.x < table_blocks + mlp_blocks) {
    const unsigned thread = (blockIdx.x - table_blocks) * kBlockThreads + threadIdx.x;
    OptimizeWeight(p, rates, static_cast<int>(thread / kWarpThreads));
  } else {
    ScoreCells(p, ((blockIdx.x - table_blocks - mlp_blocks) * kBlockThreads + threadIdx.x) * kCellsPerThread);
  }
}

__device__ uint64_t RowOf(const uint32_t* bits, int row) {
  return bits[kRowWords * row] | static_cast<uint64_t>(bits[kRowWords * row + 1]) << 32;
}

// One row of cells: the hull cells that are live or have a live neighbor.
__global__ void __launch_bounds__(kBlockThreads) OccupancyKernel(OccupancyParams p) {
  const int row = static_cast<int>(blockIdx.x * kBlockThreads + threadIdx.x);
  if (row == 0) p.slice->next = p.slice->running + 1;
  if (!UpdateIsDue(p.plan, *p.slice)) return;
  if (row < kLayers) p.layer_weight[row] = FadedLayerWeight(p.layer_weight[row]);
  const int y = row % kOccupancyResolution, z = row / kOccupancyResolution;
  uint64_t live = 0;
  for (int dz = -1; dz <= 1; ++dz) {
    for (int dy = -1; dy <= 1; ++dy) {
      const bool inside = y + dy >= 0 && y + dy < kOccupancyResolution && z + dz >= 0 && z + dz < kOccupancyResolution;
      if (inside) live |= RowOf(p.live_bits, row + dz * kOccupancyResolution + dy);
    }
  }
  const uint64_t occupied = WithNeighborsInRow(live) & RowOf(p.hull_bits, row);
  p.occupied_bits[kRowWords * row] = static_cast<uint32_t>(occupied);
  p.occupied_bits[kRowWords * row + 1] = static_cast<uint32_t>(occupied >> 32);
}

}  // namespace

cudaError_t LaunchStep(const StepLaunch& launch, MlpPath path, cudaStream_t stream) {
  const cudaError_t error = LaunchGradients(launch.step, path, stream);
  return error != cudaSuccess ? error : LaunchOptimize(launch, stream);
}

cudaError_t LaunchOptimize(const StepLaunch& launch, cudaStream_t stream) {
  const unsigned table_blocks = BlocksFor(launch.optimize.table_count);
  const unsigned mlp_blocks = BlocksFor(static_cast<size_t>(launch.optimize.mlp_count) * kWarpThreads);
  ROMAP_LAUNCH(OptimizeKernel, dim3(table_blocks + mlp_blocks + BlocksFor(kCells / kCellsPerThread)),
               dim3(kBlockThreads), 0, stream, launch.optimize, table_blocks, mlp_blocks);
  ROMAP_LAUNCH(OccupancyKernel, dim3(BlocksFor(kOccupancyResolution * kOccupancyResolution)), dim3(kBlockThreads), 0,
               stream, launch.occupancy);
  return cudaGetLastError();
}

}  // namespace romap::nerf::cuda
