#include "server/nerf/model/step_parameters.h"

namespace romap::nerf {
namespace {

constexpr float kMaxDepthError = 0.2f;  // box sides: larger depth errors are outliers

}  // namespace

LossWeights MakeLossWeights(const NerfConfig& config) {
  return {.opacity_object = static_cast<float>(config.opacity_weight_object),
          .opacity_background = static_cast<float>(config.opacity_weight_background),
          .density = config.field == "density" ? static_cast<float>(config.density_weight) : 0.0f,
          .depth = static_cast<float>(config.depth_weight),
          .contrast = static_cast<float>(config.contrast_weight),
          .depth_limit = kMaxDepthError,
          .random_background = config.random_background};
}

ShapeWeights MakeShapeWeights(const NerfConfig& config) {
  return {static_cast<float>(config.eikonal_weight), static_cast<float>(config.curvature_weight)};
}

SampleBudget MakeSampleBudget(const NerfConfig& config) {
  return {.finest_step = static_cast<float>(config.min_sample_spacing),
          .min_samples = config.min_samples_per_ray,
          .max_samples = config.max_samples_per_ray,
          .skip_empty = config.sampling == "occupied"};
}

OccupancyPlan MakeOccupancyPlan(const NerfConfig& config) {
  return {.start = static_cast<uint64_t>(config.occupancy_start_step),
          .interval = static_cast<uint64_t>(config.occupancy_interval_steps)};
}

AdamRates MakeAdamRates(const NerfConfig& config, float learning_rate) {
  return {learning_rate, static_cast<float>(config.adam_beta1), static_cast<float>(config.adam_beta2)};
}

}  // namespace romap::nerf
