#pragma once

#include <cstdint>

namespace romap::nerf {

// Plain values that formulas take, the same for every lane type and back end.

inline constexpr int kFeaturesPerLevel = 2;
inline constexpr int kMaxLevels = 16;
inline constexpr int kOutputs = 4;  // red, green, blue, density or distance, before activation

// Largest sizes of the frequency encoding and of deep MLPs.
inline constexpr int kMaxOctaves = 16;
inline constexpr int kFrequencyExtras = 4;  // x, y, z and 1 besides the waves
inline constexpr int kMaxFrequencyFeatures = (6 * kMaxOctaves + kFrequencyExtras + 15) / 16 * 16;
inline constexpr int kMaxHiddenLayers = 6;
inline constexpr int kMaxDeepWidth = 256;

// Where each level of the hash grid lies in the table; see hash_grid.h for the indexing.
struct GridLayout {
  int levels = 0;
  int features = 0;  // per point: what the encoding gives, rounded up to 16; the rest stays 0
  int octaves = 0;   // > 0: the frequency encoding (frequency.h) takes the place of the grid
  uint32_t entries = 0;
  alignas(64) float scale[kMaxLevels] = {};  // cells per unit
  alignas(64) uint32_t stride_y[kMaxLevels] = {};
  alignas(64) uint32_t stride_z[kMaxLevels] = {};
  alignas(64) uint32_t mask[kMaxLevels] = {};
  alignas(64) uint32_t offset[kMaxLevels] = {};
};

// How the Unit space of the training box lies in that of the hash grid: p_grid = rotation p_unit + shift, both in the
// same unit of length. The grid stays where the first box was.
struct GridPose {
  float rotation[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  float shift[3] = {0, 0, 0};
};

// Where the samples of a ray lie in the sample arrays.
struct RaySpan {
  int first = 0;  // sample
  int count = 0;  // 0: the ray meets nothing occupied
};

// Weights of the loss terms, all >= 0, the same for every ray.
struct LossWeights {
  float opacity_object = 0;        // times (1 - sum w) on object rays
  float opacity_background = 0;    // times sum w on background rays
  float density = 0;               // times sum sigma_i on background rays (paper: L_density)
  float depth = 0;                 // times |sum w_i (t_i - t*)| on rays with depth (paper: L_depth)
  float contrast = 0;              // times |e - e'|^2 of the colour errors of a ray and its partner
  float depth_limit = 0;           // residual beyond which a depth is taken for an outlier, in units of box side
  bool random_background = false;  // paper: L_rr; also lets object rays blend over the random colour
};

// What a ray should look like.
struct RayTarget {
  float rgb[3] = {0, 0, 0};         // 0..1
  float background[3] = {0, 0, 0};  // random colour, used when LossWeights::random_background
  float depth = -1;                 // along the ray, in units of box side; < 0: unknown
  bool is_object = true;
  // Object rays may come in pairs through pixels near each other: 1 = the next ray is the partner, -1 = the one before
  // is, 0 = there is none.
  int partner = 0;
};

inline constexpr int kOccupancyResolution = 64;  // one row of cells is one machine word (see cpu/occupancy.h)
inline constexpr int kRayProbes = 64;            // probes of the occupancy grid along a ray, one bit each
inline constexpr int kMaxSamplesPerRay = 64;

// A ray in Unit space (see TrainingBox), direction of unit length.
struct Ray {
  float origin[3];
  float direction[3];
  float jitter;  // 0..1, where in its stratum each sample lies
  RayTarget target;
};

// Samples of one ray, front to back: arrays of `count`.
struct RaySamples {
  int count;
  const float* t;       // along the ray, units of box side
  const float* length;  // delta of each sample, same units
  const float* alpha;   // StepOpacity
  const float* density;
  const float* rgb[3];  // after Sigmoid
};

struct RayResult {
  float rgb[3];
  float opacity;       // sum of weights
  float depth_excess;  // sum w_i (t_i - t*), 0 without depth
  float loss;          // all terms
  float color_loss;    // squared colour error alone
};

// Fields of signed distances (signed_distance.h): box sides inside the surface per unit of the raw output.
inline constexpr float kDistancePerRaw = 0.1f;
inline constexpr int kStencilPoints = 5;  // at which the shape of such a field is looked at

// Weights of the losses on that shape, >= 0.
struct ShapeWeights {
  float eikonal = 0;
  float curvature = 0;
};

struct AdamRates {
  float learning_rate = 0;
  float beta1 = 0;
  float beta2 = 0;
};

}  // namespace romap::nerf
