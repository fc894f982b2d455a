#pragma once

#include <cstdint>

namespace romap::nerf {

// Plain data types that the formulas use, the same for every lane type and back end.

inline constexpr int kFeaturesPerLevel = 2;
inline constexpr int kMaxLevels = 16;
inline constexpr int kOutputs = 4;  // red, green, blue, density or distance, before activation

// Largest sizes of the frequency encoding and of deep MLPs.
inline constexpr int kMaxOctaves = 16;
inline constexpr int kFrequencyExtras = 4;  // x, y, z and 1, in addition to the waves
inline constexpr int kMaxFrequencyFeatures = (6 * kMaxOctaves + kFrequencyExtras + 15) / 16 * 16;
inline constexpr int kMaxHiddenLayers = 6;
inline constexpr int kMaxDeepWidth = 256;

// Layout of the hash grid's levels in the table; see hash_grid.h for the indexing.
struct GridLayout {
  int levels = 0;
  int features = 0;  // per point: outputs of the encoding, rounded up to a multiple of 16; the padding is 0
  int octaves = 0;   // > 0: the frequency encoding (frequency.h) replaces the grid
  uint32_t entries = 0;
  alignas(64) float scale[kMaxLevels] = {};  // cells per unit
  alignas(64) uint32_t stride_y[kMaxLevels] = {};
  alignas(64) uint32_t stride_z[kMaxLevels] = {};
  alignas(64) uint32_t mask[kMaxLevels] = {};
  alignas(64) uint32_t offset[kMaxLevels] = {};
};

// Pose of the training box's Unit space in that of the hash grid: p_grid = rotation p_unit + shift, both in the same
// unit of length. The grid keeps the pose of the first box.
struct GridPose {
  float rotation[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  float shift[3] = {0, 0, 0};
};

// Range of a ray's samples in the sample arrays.
struct RaySpan {
  int first = 0;  // sample
  int count = 0;  // 0: the ray intersects no occupied cell
};

// Training target of a ray.
struct RayTarget {
  float rgb[3] = {0, 0, 0};         // 0..1
  float background[3] = {0, 0, 0};  // random color, used if LossWeights::random_background
  float depth = -1;                 // along the ray, in units of box side; < 0: unknown
  bool is_object = true;
  // Object rays may form pairs through nearby pixels: 1 = the next ray is the partner, -1 = the previous ray is the
  // partner, 0 = no partner.
  int partner = 0;
};

inline constexpr int kOccupancyResolution = 64;  // one row of cells is one machine word (see model/occupancy.h)
inline constexpr int kRayProbes = 64;            // probes of the occupancy grid along a ray, one bit each
inline constexpr int kMaxSamplesPerRay = 64;

// A ray in Unit space (see TrainingBox), direction of unit length.
struct Ray {
  float origin[3];
  float direction[3];
  float jitter;  // 0..1, position of each sample within its stratum
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
  float opacity;      // sum of weights
  float depth_error;  // sum w_i (t_i - t*), 0 without depth
  float density_sum;
  // Set by LossOfRay; compositing sets them to 0.
  float loss;        // all terms
  float color_loss;  // squared color error alone
};

// Loss of a ray and its derivatives with respect to the fields of its RayResult.
struct RayLoss {
  float value;  // all terms
  float color;  // squared color error alone
  float d_rgb[3];
  float d_opacity;
  float d_depth_error;
  float d_density;  // with respect to the density of each sample
};

// Fields of signed distances (signed_distance.h): box sides inside the surface per unit of the raw output.
inline constexpr float kDistancePerRaw = 0.1f;
inline constexpr int kStencilPoints = 5;  // points at which the shape of such a field is evaluated around a center

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
