#pragma once

// What a block keeps in shared memory of the samples it works on.

#include "server/nerf/cuda/cuda_launch.h"
#include "server/nerf/cuda/field_kernels.h"

namespace romap::nerf::cuda {

inline constexpr int kTileWarps = kTileSamples / kWarpThreads;
inline constexpr int kEdge = 16;  // of the square tiles that tensor cores multiply

// A factor of the MLP's products. What is too large for a half becomes the largest one; what is not a number stays so.
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

// How a ray runs through the box.
struct RayWay {
  float entry, piece;  // see sampling.h
  float length;        // of each sample's step
  int count;           // samples; 0 when the ray meets nothing
  uint64_t occupied;
};

// Rays of a tile: an even number, so that pairs stay together.
__host__ __device__ inline int RaySlots(int samples_per_ray) { return kTileSamples / samples_per_ray / 2 * 2; }

// Places in a block's memory, all aligned to 128 bytes. T holds the MLP's factors: half or float.
template <class T>
struct Tile {
  // Rows of T are longer than what they hold, so that columns spread over the banks and, of halves, every 16th row
  // begins at a multiple of 32 bytes, as tensor cores want.
  static constexpr int kPad = sizeof(T) == 2 ? 8 : 1;
  static constexpr int kOutputRow = kEdge;  // without, to fit where it lies

  int features, hidden;         // of the field
  int feature_row, hidden_row;  // T from row to row
  int ray_slots, samples_per_ray;

  RayWay* ways;  // [ray_slots]
  // [kTileSamples]: the samples of ray r begin at r * samples_per_ray.
  float *x, *y, *z, *t, *length, *red, *green, *blue, *density, *alpha, *weight, *behind;
  float* raw;   // [kTileSamples][kOutputs]: outputs, then the loss' derivatives by them
  int* active;  // whether the sample has a backward pass
  T* feature;   // [kTileSamples][feature_row]
  T* neuron;    // [kTileSamples][hidden_row]: after ReLU, then its gradient
  // For tensor cores.
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

// Hands out parts of a block's memory; without memory it only counts.
class Arena {
 public:
  __host__ __device__ explicit Arena(unsigned char* memory) : memory_(memory) {}
  template <class V>
  __host__ __device__ void Take(V*& place, int count) {
    place = memory_ == nullptr ? nullptr : reinterpret_cast<V*>(memory_ + bytes_);
    bytes_ += (static_cast<size_t>(count) * sizeof(V) + 127) / 128 * 128;
  }
  __host__ __device__ size_t bytes() const { return bytes_; }

 private:
  unsigned char* memory_;
  size_t bytes_ = 0;
};

// The part that evaluating points needs, too.
template <class T>
__host__ __device__ void LayOutMlp(const DeviceField& field, Arena& arena, Tile<T>& tile) {
  tile.features = field.grid.features;
  tile.hidden = field.hidden;
  tile.feature_row = tile.features + Tile<T>::kPad;
  tile.hidden_row = tile.hidden + Tile<T>::kPad;
  arena.Take(tile.raw, kTileSamples * kOutputs);
  arena.Take(tile.feature, kTileSamples * tile.feature_row);
  arena.Take(tile.neuron, kTileSamples * tile.hidden_row);
  if (sizeof(T) != 2) return;
  arena.Take(tile.in_weight, tile.features * tile.hidden_row);
  arena.Take(tile.out_weight, kEdge * tile.hidden_row);
  arena.Take(tile.staging, kTileWarps * kEdge * kEdge);
}

template <class T>
__host__ __device__ size_t LayOutTile(const DeviceField& field, int samples_per_ray, unsigned char* memory,
                                      Tile<T>& tile) {
  Arena arena(memory);
  LayOutMlp(field, arena, tile);
  tile.samples_per_ray = samples_per_ray;
  tile.ray_slots = RaySlots(samples_per_ray);
  arena.Take(tile.ways, tile.ray_slots);
  for (float** array : {&tile.x, &tile.y, &tile.z, &tile.weight}) arena.Take(*array, kTileSamples);
  arena.Take(tile.active, kTileSamples);
  float** const rendering[] = {&tile.t,    &tile.length,  &tile.red,   &tile.green,
                               &tile.blue, &tile.density, &tile.alpha, &tile.behind};
  for (float** array : rendering) arena.Take(*array, kTileSamples);
  // When a backward pass begins, rendering is over; its arrays, one after another, make place.
  static_assert(sizeof(rendering) / sizeof(*rendering) * sizeof(float) >= Tile<T>::kOutputRow * sizeof(__half));
  tile.d_output = reinterpret_cast<T*>(tile.t);
  arena.Take(tile.weight_gradient, tile.WeightGradients());
  arena.Take(tile.layer_weight, kLayers);
  arena.Take(tile.warp_largest, kTileWarps);
  return arena.bytes();
}

}  // namespace romap::nerf::cuda
