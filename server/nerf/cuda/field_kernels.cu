#include "server/nerf/cuda/field_kernels.h"
#include "server/nerf/math/activation.h"
#include "server/nerf/math/adam.h"
#include "server/nerf/math/composite.h"
#include "server/nerf/math/dense.h"
#include "server/nerf/math/hash_grid.h"

namespace romap::nerf::cuda {
namespace {

using plain::DenseMode;

constexpr unsigned kBlockThreads = 128;
constexpr int kSliceSamples = 256;  // one thread's share of a weight's gradient

unsigned BlockCount(size_t threads) { return static_cast<unsigned>((threads + kBlockThreads - 1) / kBlockThreads); }

__device__ inline size_t ThreadInGrid() { return static_cast<size_t>(blockIdx.x) * blockDim.x + threadIdx.x; }

// Takes the place of Quad where many threads add to one table: loading gives zeros, storing adds.
struct AtomicQuad : plain::Quad {
  __device__ AtomicQuad(const plain::Quad& quad) : plain::Quad(quad) {}
  static __device__ AtomicQuad Load(const float*) { return plain::Quad{{0.0f, 0.0f, 0.0f, 0.0f}}; }
  __device__ AtomicQuad Plus(const plain::Quad& other, float s) const { return plain::Quad::Plus(other, s); }
  __device__ void Store(float* p) const {
    for (int i = 0; i < 4; ++i) atomicAdd(p + i, v[i]);
  }
};

__device__ inline plain::GridCell<float> CellOf(const GridLayout& grid, int level, float x, float y, float z) {
  return plain::LocateCell(x, y, z, grid.scale[level], grid.stride_y[level], grid.stride_z[level], grid.mask[level],
                           grid.offset[level]);
}

// features[grid.features], hidden[field.hidden] and raw[kOutputs] (without density bias) of one point.
__device__ inline void EvaluatePoint(const FieldView& field, float x, float y, float z, float* features, float* hidden,
                                     float* raw) {
  const GridLayout& grid = field.grid;
  for (int level = 0; level < grid.levels; ++level) {
    const plain::GridCell<float> cell = CellOf(grid, level, x, y, z);
    plain::InterpolateCell<plain::Quad>(field.table, cell.pair, cell.weight, cell.along_x, 1,
                                        features + kFeaturesPerLevel * level);
  }
  for (int f = kFeaturesPerLevel * grid.levels; f < grid.features; ++f) features[f] = 0.0f;
  for (int h = 0; h < field.hidden; ++h) {
    plain::DenseTile<float, 1, 1, DenseMode::kRelu>(features, grid.features, grid.features, field.parameters + h,
                                                    field.hidden, hidden + h);
  }
  const float* out_weights = field.parameters + grid.features * field.hidden;
  for (int o = 0; o < kOutputs; ++o) {
    // A row of the weights read as a column: consecutive k are 1 apart.
    plain::DenseTile<float, 1, 1, DenseMode::kLinear>(hidden, field.hidden, field.hidden,
                                                      out_weights + o * field.hidden, 1, raw + o);
  }
}

__global__ void EvaluateKernel(EvaluateParams p) {
  const size_t i = ThreadInGrid();
  if (i >= static_cast<size_t>(p.count)) return;
  float features[kMaxFeatures], hidden[kMaxHidden], raw[kOutputs];
  EvaluatePoint(p.field, p.x[i], p.y[i], p.z[i], features, hidden, raw);
  for (int c = 0; c < 3; ++c) p.value[kOutputs * i + c] = plain::Sigmoid(raw[c]);
  p.value[kOutputs * i + 3] = raw[3] + p.field.density_bias;
}

// One thread per sample.
__global__ void ForwardKernel(ForwardParams p) {
  const SampleView& s = p.samples;
  const size_t i = ThreadInGrid();
  if (i >= static_cast<size_t>(s.count)) return;
  float raw[kOutputs];
  EvaluatePoint(p.field, s.x[i], s.y[i], s.z[i], s.features + i * p.field.grid.features, s.hidden + i * p.field.hidden,
                raw);
  s.red[i] = plain::Sigmoid(raw[0]);
  s.green[i] = plain::Sigmoid(raw[1]);
  s.blue[i] = plain::Sigmoid(raw[2]);
  s.density[i] = plain::Density(raw[3] + p.field.density_bias);
  s.alpha[i] = plain::StepOpacity(s.density[i], s.length[i]);
}

// One thread per ray.
__global__ void CompositeKernel(CompositeParams p) {
  const size_t r = ThreadInGrid();
  if (r >= static_cast<size_t>(p.ray_count)) return;
  const RaySpan span = p.spans[r];
  if (span.count == 0) return;
  const SampleView& s = p.samples;
  const int at = span.first;
  const RaySamples ray{span.count,   s.t + at,       s.length + at,
                       s.alpha + at, s.density + at, {s.red + at, s.green + at, s.blue + at}};
  float* d_raw = s.d_raw + static_cast<size_t>(kOutputs) * at;
  const RayResult result = plain::CompositeForward(ray, p.targets[r], p.loss_weights, s.weight + at, s.behind + at);
  plain::CompositeBackward(ray, p.targets[r], p.loss_weights, result, s.weight + at, s.behind + at, d_raw);
  p.results[r] = result;
  for (int i = 0; i < span.count; ++i, d_raw += kOutputs) {
    const float size = std::fabs(d_raw[0]) + std::fabs(d_raw[1]) + std::fabs(d_raw[2]) + std::fabs(d_raw[3]);
    // Not a product with 0: it must not hide a NaN that passes the cut.
    for (int o = 0; o < kOutputs; ++o) d_raw[o] = size <= p.gradient_cut ? 0.0f : d_raw[o] * p.gradient_scale;
  }
}

// One thread per sample.
__global__ void BackwardKernel(BackwardParams p) {
  const SampleView& s = p.samples;
  const size_t i = ThreadInGrid();
  if (i >= static_cast<size_t>(s.count)) return;
  const GridLayout& grid = p.field.grid;
  const int hidden = p.field.hidden;
  const float* d_raw = s.d_raw + kOutputs * i;
  float* d_hidden = s.d_hidden + i * hidden;
  if (d_raw[0] == 0.0f && d_raw[1] == 0.0f && d_raw[2] == 0.0f && d_raw[3] == 0.0f) {
    for (int h = 0; h < hidden; ++h) d_hidden[h] = 0.0f;
    return;
  }
  const float* out_weights = p.field.parameters + grid.features * hidden;
  for (int h = 0; h < hidden; ++h) {
    d_hidden[h] = s.hidden[i * hidden + h];  // the mask
    plain::DenseTile<float, 1, 1, DenseMode::kMaskedByOut>(d_raw, kOutputs, kOutputs, out_weights + h, hidden,
                                                           d_hidden + h);
  }
  for (int level = 0; level < grid.levels; ++level) {
    float d_feature[kFeaturesPerLevel];
    for (int f = 0; f < kFeaturesPerLevel; ++f) {
      const float* row = p.field.parameters + (kFeaturesPerLevel * level + f) * hidden;
      plain::DenseTile<float, 1, 1, DenseMode::kLinear>(d_hidden, hidden, hidden, row, 1, d_feature + f);
    }
    const plain::GridCell<float> cell = CellOf(grid, level, s.x[i], s.y[i], s.z[i]);
    plain::ScatterCell<AtomicQuad>(p.table_gradient, cell.pair, cell.weight, cell.along_x, 1, d_feature);
  }
}

// One thread per weight and slice of samples; neighbouring threads read neighbouring neurons.
__global__ void WeightGradientKernel(WeightGradientParams p) {
  const SampleView& s = p.samples;
  const int weight = static_cast<int>(ThreadInGrid());
  if (weight >= (p.features + kOutputs) * p.hidden) return;
  const int row = weight / p.hidden, neuron = weight % p.hidden;
  const size_t first = static_cast<size_t>(blockIdx.y) * kSliceSamples;
  const int left = s.count - static_cast<int>(first);
  const int samples = left < kSliceSamples ? left : kSliceSamples;
  float sum = 0.0f;
  if (row < p.features) {
    plain::OuterTile<float, 1, 1>(samples, s.features + first * p.features + row, p.features,
                                  s.d_hidden + first * p.hidden + neuron, p.hidden, &sum);
  } else {
    plain::OuterTile<float, 1, 1>(samples, s.d_raw + first * kOutputs + (row - p.features), kOutputs,
                                  s.hidden + first * p.hidden + neuron, p.hidden, &sum);
  }
  atomicAdd(p.mlp_gradient + weight, sum);
}

// One thread per parameter.
__global__ void AdamKernel(AdamParams p) {
  const size_t i = ThreadInGrid();
  if (i >= p.count) return;
  const float gradient = p.gradient[i];
  if (gradient == 0.0f) return;  // most entries of the fine levels, at any one step
  p.gradient[i] = 0.0f;
  plain::AdamUpdate(gradient, p.rates, p.parameters[i], p.first[i], p.second[i]);
}

}  // namespace

cudaError_t LaunchEvaluate(const EvaluateParams& params, cudaStream_t stream) {
  if (params.field.hidden > kMaxHidden || params.field.grid.features > kMaxFeatures) return cudaErrorInvalidValue;
  if (params.count == 0) return cudaSuccess;
  ROMAP_LAUNCH(EvaluateKernel, dim3(BlockCount(static_cast<size_t>(params.count))), dim3(kBlockThreads), 0, stream,
               params);
  return cudaGetLastError();
}

cudaError_t LaunchGradients(const GradientStep& step, cudaStream_t stream) {
  const SampleView& samples = step.composite.samples;
  if (samples.count == 0) return cudaSuccess;
  const dim3 block(kBlockThreads), over_samples(BlockCount(static_cast<size_t>(samples.count)));
  const dim3 over_rays(BlockCount(static_cast<size_t>(step.composite.ray_count)));
  const int features = step.field.grid.features, hidden = step.field.hidden;
  const dim3 over_weights(BlockCount(static_cast<size_t>((features + kOutputs) * hidden)),
                          static_cast<unsigned>((samples.count + kSliceSamples - 1) / kSliceSamples));
  const ForwardParams forward{step.field, samples};
  const BackwardParams backward{step.field, samples, step.table_gradient};
  const WeightGradientParams weights{samples, features, hidden, step.mlp_gradient};
  ROMAP_LAUNCH(ForwardKernel, over_samples, block, 0, stream, forward);
  ROMAP_LAUNCH(CompositeKernel, over_rays, block, 0, stream, step.composite);
  ROMAP_LAUNCH(BackwardKernel, over_samples, block, 0, stream, backward);
  ROMAP_LAUNCH(WeightGradientKernel, over_weights, block, 0, stream, weights);
  return cudaGetLastError();
}

cudaError_t LaunchAdam(const AdamParams& params, cudaStream_t stream) {
  if (params.count == 0) return cudaSuccess;
  ROMAP_LAUNCH(AdamKernel, dim3(BlockCount(params.count)), dim3(kBlockThreads), 0, stream, params);
  return cudaGetLastError();
}

}  // namespace romap::nerf::cuda
