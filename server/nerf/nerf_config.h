#pragma once

#include <string>

#include "common/config.h"

namespace romap::nerf {

// The field of one object and its training. The defaults are the fast preset, measured on two CPU cores; the help texts
// give the paper's values.
struct NerfConfig {
  std::string preset = "fast";  // see presets.h

  // Field: output, encoding and MLP.
  std::string field = "density";
  std::string encoding = "hash";
  int levels = 8;
  int log2_table_entries = 14;
  int base_resolution = 16;
  int finest_resolution = 1024;
  int hidden_width = 32;
  int hidden_layers = 1;
  double density_bias = 2.0;
  double surface_level = 3.0;

  // Box, hull and occupancy.
  double box_enlargement = 0.1;
  double hull_margin = 0.8;
  bool carve_hull = true;
  int hull_min_votes = 1;
  double hull_vote_share = 0.08;
  double hull_trim_share = 0.002;
  double hull_show_share = 0.25;
  double mask_border_spreads = 2;
  int occupancy_start_step = 40;
  int occupancy_interval_steps = 20;
  double occupancy_decay = 0.9;
  double occupancy_threshold = 0.01;

  // Rays and samples.
  int rays_per_step = 1024;
  double background_share = 0.3;
  double sparse_depth_share = 0.1;
  std::string sampling = "occupied";
  int max_samples_per_ray = 16;
  int min_samples_per_ray = 4;
  double min_sample_spacing = 0.01;

  // Loss.
  double opacity_weight_object = 0.5;
  double opacity_weight_background = 0.5;
  double density_weight = 0.01;
  double contrast_weight = 1.0;
  double depth_weight = 0.5;
  bool random_background = false;
  double initial_sharpness = 20;
  double final_sharpness = 1000;
  double eikonal_weight = 0.01;
  double curvature_weight = 0.001;

  // Optimizer.
  double learning_rate = 0.02;
  double final_learning_rate = 0.002;
  double adam_beta1 = 0.8;
  double adam_beta2 = 0.95;
  double min_sample_gradient = 1e-5;

  // Where training runs.
  std::string backend = "auto";

  // Schedule of the training pool.
  int min_views = 3;
  int first_budget_steps = 80;
  int budget_steps_per_view = 20;
  int full_budget_steps = 600;
  int refine_steps_per_view = 6;
  int max_refine_steps = 200;
  int slice_steps = 20;
  int snapshot_interval_steps = 40;
  double snapshot_interval_s = 1.0;
  double completion_delay_s = 1.0;
  int probe_interval_steps = 25;
  double min_loss_decrease = 0.1;
  int max_extra_steps = 100;
  double max_training_time_s = 8.0;
  double max_training_time_per_view_s = 0.3;
  double pose_prior_px = 8.0;

  void Fields(ConfigFields& fields);
  void Validate(ConfigRules& rules) const;
};

}  // namespace romap::nerf
