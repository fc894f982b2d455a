#pragma once

// The shared memory of a block: the samples of one tile of rays, and sums over tiles.

#include "server/nerf/cuda/cuda_launch.h"
#include "server/nerf/cuda/field_kernels.h"

namespace romap::nerf::cuda {

inline constexpr int kTileWarps = kTileSamples / kWarpThreads;
inline constexpr int kEdge = 16;  // side of the square matrices that tensor cores multiply

// A factor of the MLP's products. Values beyond the range of a half are clamped to it; NaN is kept.
template <class T>
__device__ T Rounded(float x);
template <>
__device__ inline float Rounded<float>(float x) {
  return x;
}
template <>
__device__ inline __half Rounded<__half>(float x) {
  constexpr float kLargest = 65504.0f;
  return __float2half(x > kLargest ? kLargest : x < -kLargest ? -kLargest : x);
}

// The segment of a ray inside the box; see math/sampling.h.
struct RaySegment {
  float entry, piece;  // t at the entry, length of a piece
  float length;        // of the step of each sample
  int count;           // samples; 0 if the ray intersects no occupied cell
  uint64_t occupied;   // bit k: piece k is occupied
};

// Arrays in the memory of a block, all aligned to 128 bytes. T: type of the MLP's factors, half or float.
template <class T>
struct Tile {
  // Rows of T are padded, so that columns spread over the banks of shared memory. For halves, every 16th row starts at
  // a multiple of 32 bytes, as tensor cores require.
  static constexpr int kPad = sizeof(T) == 2 ? 8 : 1;
  static constexpr int kOutputRow = kEdge;  // no padding, so that d_output fits into the arrays it reuses

  int features, hidden;         // of the field
  int feature_row, hidden_row;  // stride of rows, in T
  int ray_slots, samples_per_ray;

  RaySegment* segments;  // [ray_slots]
  // [kTileSamples]: the samples of ray r start at r * samples_per_ray.
  float *x, *y, *z, *t, *length, *red, *green, *blue, *density, *alpha, *weight, *behind;
  float* raw;   // [kTileSamples][kOutputs]: raw outputs, then the derivatives of the loss with respect to them
  int* active;  // [kTileSamples]: whether the sample has a backward pass
  T* feature;   // [kTileSamples][feature_row]
  T* neuron;    // [kTileSamples][hidden_row]: after ReLU, then its gradient
  // Only for tensor cores.
  T* d_output;     // [kTileSamples][kOutputRow]: raw, scaled; 0 from kOutputs on
  T* in_weight;    // [features][hidden_row]
  T* out_weight;   // [kEdge][hidden_row]: 0 from kOutputs on
  float* staging;  // [kTileWarps][kEdge][kEdge]
  // Sums over all tiles of the block.
  float* weight_gradient;  // [features + (kEdge or kOutputs)][hidden]
  uint32_t* layer_weight;  // [kLayers]
  float* warp_largest;     // [kTileWarps]

  __host__ __device__ static int OutputRows() { return sizeof(T) == 2 ? kEdge : kOutputs; }
  __host__ __device__ int WeightGradients() const { return (features + OutputRows()) * hidden; }
};

// Allocates parts of the memory of a block; with null memory it only computes their total size.
class Arena {
 public:
  __host__ __device__ explicit Arena(unsigned char* memory) : memory_(memory) {}
  template <class V>
  __host__ __device__ void Allocate(V*& array, int count) {
    array = memory_ == nullptr ? nullptr : reinterpret_cast<V*>(memory_ + bytes_);
    bytes_ += (static_cast<size_t>(count) * sizeof(V) + 127) / 128 * 128;
  }
  __host__ __device__ size_t bytes() const { return bytes_; }

 private:
  unsigned char* memory_;
  size_t bytes_ = 0;
};

// Allocates the arrays that both training and the evaluation of points need.
template <class T>
__host__ __device__ void LayOutMlp(const DeviceField& field, Arena& arena, Tile<T>& tile) {
  tile.features = field.grid.features;
  tile.hidden = field.hidden;
  tile.feature_row = tile.features + Tile<T>::kPad;
  tile.hidden_row = tile.hidden + Tile<T>::kPad;
  arena.Allocate(tile.raw, kTileSamples * kOutputs);
  arena.Allocate(tile.feature, kTileSamples * tile.feature_row);
  arena.Allocate(tile.neuron, kTileSamples * tile.hidden_row);
  if (sizeof(T) != 2) return;
  arena.Allocate(tile.in_weight, tile.features * tile.hidden_row);
  arena.Allocate(tile.out_weight, kEdge * tile.hidden_row);
  arena.Allocate(tile.staging, kTileWarps * kEdge * kEdge);
}

template <class T>
__host__ __device__ size_t LayOutTile(const DeviceField& field, int samples_per_ray, unsigned char* memory,
                                      Tile<T>& tile) {
  Arena arena(memory);
  LayOutMlp(field, arena, tile);
  tile.samples_per_ray = samples_per_ray;
  tile.ray_slots = RaysThatFit(kTileSamples, samples_per_ray);
  arena.Allocate(tile.segments, tile.ray_slots);
  for (float** array : {&tile.x, &tile.y, &tile.z, &tile.weight}) arena.Allocate(*array, kTileSamples);
  arena.Allocate(tile.active, kTileSamples);
  float** const rendering[] = {&tile.t,    &tile.length,  &tile.red,   &tile.green,
                               &tile.blue, &tile.density, &tile.alpha, &tile.behind};
  for (float** array : rendering) arena.Allocate(*array, kTileSamples);
  // The backward pass reuses the arrays of the rendering, which are contiguous and no longer needed.
  static_assert(sizeof(rendering) / sizeof(*rendering) * sizeof(float) >= Tile<T>::kOutputRow * sizeof(__half));
  tile.d_output = reinterpret_cast<T*>(tile.t);
  arena.Allocate(tile.weight_gradient, tile.WeightGradients());
  arena.Allocate(tile.layer_weight, kLayers);
  arena.Allocate(tile.warp_largest, kTileWarps);
  return arena.bytes();
}

}  // namespace romap::nerf::cuda
