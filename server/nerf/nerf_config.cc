#include "server/nerf/nerf_config.h"

#include <fmt/format.h>

#include "server/nerf/presets.h"

namespace romap::nerf {
namespace {

void FieldFields(NerfConfig& c, ConfigFields& fields) {
  fields.Add("preset", &c.preset,
             {.choices = NerfPresetNames(),
              .audience = Audience::kOperator,
              .help = "Base values of the nerf settings: fast, or as in the paper; settings in the same file and later "
                      "--set options override them",
              .on_set = [&c](const std::string& name) { c = *NerfPreset(name); }});
  fields.Add("field", &c.field,
             {.choices = {"density", "sdf"}, .help = "Output of the field: density or signed distance (CPU only)"});
  fields.Add("encoding", &c.encoding,
             {.choices = {"hash", "frequency"},
              .help = "Encoding of positions: hash grid, or sines and cosines (for baselines, CPU only)"});
  fields.Add("levels", &c.levels,
             {.min = 1,
              .max = 16,
              .help = "Number of hash grid levels with two features each (paper: 16), or of octaves of sines and "
                      "cosines"});
  fields.Add("log2_table_entries", &c.log2_table_entries,
             {.min = 8, .max = 22, .help = "log2 of the number of hash table entries per level (paper: 16)"});
  fields.Add("base_resolution", &c.base_resolution,
             {.unit = "cells per box side", .min = 2, .max = 256, .help = "Resolution of the coarsest level"});
  fields.Add(
      "finest_resolution", &c.finest_resolution,
      {.unit = "cells per box side", .min = 2, .max = 16384, .help = "Resolution of the finest level (paper: 2048)"});
  fields.Add(
      "hidden_width", &c.hidden_width,
      {.unit = "neurons", .min = 16, .max = 256, .multiple_of = 16, .help = "Width of a hidden layer (paper: 64)"});
  fields.Add("hidden_layers", &c.hidden_layers,
             {.unit = "layers", .min = 1, .max = 6, .help = "Number of hidden layers of the MLP (paper: 1)"});
  fields.Add(
      "density_bias", &c.density_bias,
      {.min = -10,
       .max = 10,
       .help = "Offset of the raw density, the logarithm of the density per box side; sets the initial density"});
  fields.Add("surface_level", &c.surface_level,
             {.min = -10, .max = 10, .help = "Raw density at the surface, including density_bias"});
}

void SpaceFields(NerfConfig& c, ConfigFields& fields) {
  fields.Add("box_enlargement", &c.box_enlargement,
             {.min = 0, .max = 2, .help = "Enlargement of the cuboid to the training box, as a share of its size"});
  fields.Add("hull_margin", &c.hull_margin,
             {.min = 0,
              .max = 4,
              .help = "Radius of a hull cell in the masks, as a share of the radius of its circumscribed sphere"});
  fields.Add("carve_hull", &c.carve_hull, {.help = "Keep cells outside the visual hull of the masks empty"});
  fields.Add("hull_min_votes", &c.hull_min_votes,
             {.unit = "views",
              .min = 1,
              .max = 100,
              .help = "A hull cell is emptied if the masks of at least this many views exclude it"});
  fields.Add(
      "hull_vote_share", &c.hull_vote_share,
      {.min = 0,
       .max = 1,
       .help = "A hull cell is emptied if the masks of at least this share of the views that contain it exclude it"});
  fields.Add(
      "hull_trim_share", &c.hull_trim_share,
      {.min = 0,
       .max = 0.2,
       .help = "Outer layers of the hull are removed if less than this share of all rays ends in them; 0 = never"});
  fields.Add(
      "hull_show_share", &c.hull_show_share,
      {.min = 0,
       .max = 1,
       .help = "A hull cell is emptied if fewer than this share of the images that contain it show the object there"});
  fields.Add("mask_border_spreads", &c.mask_border_spreads,
             {.min = 0,
              .max = 10,
              .help = "Background pixels this close to a mask do not empty hull cells, in standard deviations of the "
                      "measured noise of the masks' borders; 0 = masks are exact"});
  fields.Add("occupancy_start_step", &c.occupancy_start_step,
             {.unit = "steps",
              .min = 0,
              .max = 100000,
              .help = "Number of steps after which cells without density are skipped"});
  fields.Add(
      "occupancy_interval_steps", &c.occupancy_interval_steps,
      {.unit = "steps", .min = 1, .max = 100000, .help = "Number of steps between updates of the occupied cells"});
  fields.Add("occupancy_decay", &c.occupancy_decay,
             {.min = 0, .max = 1, .help = "Factor by which the stored weight of a cell decays at every visit"});
  fields.Add("occupancy_threshold", &c.occupancy_threshold,
             {.min = 0,
              .max = 1,
              .help = "Minimum weight of an occupied cell; samples lie in occupied cells and their neighbors"});
}

void RayFields(NerfConfig& c, ConfigFields& fields) {
  fields.Add("rays_per_step", &c.rays_per_step,
             {.unit = "rays", .min = 64, .max = 65536, .help = "Rays per training step (paper: 4096)"});
  fields.Add("background_share", &c.background_share,
             {.min = 0, .max = 0.9, .help = "Share of the rays of a step through background pixels"});
  fields.Add("sparse_depth_share", &c.sparse_depth_share,
             {.min = 0, .max = 0.5, .help = "Maximum share of the rays of a step through pixels with a map point"});
  fields.Add("sampling", &c.sampling,
             {.choices = {"occupied", "uniform"},
              .help = "Placement of samples on a ray: in occupied cells only, or evenly between entry and exit of the "
                      "box (paper)"});
  fields.Add("max_samples_per_ray", &c.max_samples_per_ray,
             {.unit = "samples", .min = 1, .max = 64, .help = "Maximum number of samples on a ray (paper: 32)"});
  fields.Add("min_samples_per_ray", &c.min_samples_per_ray,
             {.unit = "samples", .min = 1, .max = 64, .help = "Minimum number of samples on a ray"});
  fields.Add("min_sample_spacing", &c.min_sample_spacing,
             {.unit = "box sides",
              .min = 1e-4,
              .max = 1,
              .help = "Minimum distance between samples, unless min_samples_per_ray requires a smaller one"});
}

void LossFields(NerfConfig& c, ConfigFields& fields) {
  fields.Add("opacity_weight_object", &c.opacity_weight_object,
             {.min = 0, .max = 100, .help = "Weight of 1 - opacity on object rays in the loss"});
  fields.Add("opacity_weight_background", &c.opacity_weight_background,
             {.min = 0, .max = 100, .help = "Weight of opacity on background rays in the loss"});
  fields.Add("density_weight", &c.density_weight,
             {.min = 0, .max = 100, .help = "Weight of the density on background rays in the loss (paper: 0.01)"});
  fields.Add("contrast_weight", &c.contrast_weight,
             {.min = 0,
              .max = 100,
              .help = "Weight of errors in the color difference of two nearby pixels in the loss; 0 = no pixel pairs"});
  fields.Add("depth_weight", &c.depth_weight,
             {.min = 0, .max = 100, .help = "Weight of depth errors, in box sides, in the loss (paper: 0.5)"});
  fields.Add("random_background", &c.random_background,
             {.help = "Composite every ray over a random color (L_rr of the paper)"});
  fields.Add("initial_sharpness", &c.initial_sharpness,
             {.unit = "per box side", .min = 1, .max = 1000, .help = "Surface sharpness at the first step, for sdf"});
  fields.Add("final_sharpness", &c.final_sharpness,
             {.unit = "per box side", .min = 10, .max = 100000, .help = "Surface sharpness at the last step, for sdf"});
  fields.Add("eikonal_weight", &c.eikonal_weight,
             {.min = 0, .max = 10, .help = "Weight of (|gradient| - 1)^2 in the loss, for sdf"});
  fields.Add("curvature_weight", &c.curvature_weight,
             {.min = 0, .max = 10, .help = "Weight of the squared curvature in the loss, for sdf"});
}

void OptimizerFields(NerfConfig& c, ConfigFields& fields) {
  fields.Add("learning_rate", &c.learning_rate,
             {.min = 1e-6, .max = 1, .help = "Learning rate of Adam at the first step"});
  fields.Add("final_learning_rate", &c.final_learning_rate,
             {.min = 1e-7, .max = 1, .help = "Learning rate of Adam at the last planned step"});
  fields.Add("adam_beta1", &c.adam_beta1, {.min = 0, .max = 0.9999, .help = "Decay of Adam's mean of gradients"});
  fields.Add("adam_beta2", &c.adam_beta2,
             {.min = 0, .max = 0.9999, .help = "Decay of Adam's mean of squared gradients"});
  fields.Add("min_sample_gradient", &c.min_sample_gradient,
             {.min = 0, .max = 1, .help = "Minimum gradient of a sample that is included in the backward pass"});
  fields.Add("backend", &c.backend,
             {.choices = {"auto", "cpu", "cuda"},
              .audience = Audience::kOperator,
              .help = "Device that trains fields; auto = a CUDA device if available, otherwise the CPU; cuda = the "
                      "same, with a warning if the CPU is used"});
}

void ScheduleFields(NerfConfig& c, ConfigFields& fields) {
  fields.Add("min_views", &c.min_views,
             {.unit = "views",
              .min = 1,
              .max = 100,
              .help = "Minimum number of views of an object before its training starts"});
  fields.Add("first_budget_steps", &c.first_budget_steps,
             {.unit = "steps", .min = 1, .max = 100000, .help = "Number of steps allowed with min_views views"});
  fields.Add("budget_steps_per_view", &c.budget_steps_per_view,
             {.unit = "steps",
              .min = 0,
              .max = 10000,
              .help = "Number of steps that each further view adds, up to full_budget_steps"});
  fields.Add("full_budget_steps", &c.full_budget_steps,
             {.unit = "steps", .min = 1, .max = 100000, .help = "Number of steps of a complete training"});
  fields.Add("refine_steps_per_view", &c.refine_steps_per_view,
             {.unit = "steps",
              .min = 0,
              .max = 10000,
              .help = "Number of steps that each view adds after a complete training"});
  fields.Add("max_refine_steps", &c.max_refine_steps,
             {.unit = "steps",
              .min = 0,
              .max = 100000,
              .help = "Maximum number of steps by which new views can extend a complete training at a time"});
  fields.Add("slice_steps", &c.slice_steps,
             {.unit = "steps",
              .min = 1,
              .max = 1000,
              .help = "Number of steps that a thread trains one object before it switches to another"});
  fields.Add(
      "snapshot_interval_steps", &c.snapshot_interval_steps,
      {.unit = "steps", .min = 1, .max = 100000, .help = "Maximum number of steps between two meshes of an object"});
  fields.Add("snapshot_interval_s", &c.snapshot_interval_s,
             {.unit = "s", .min = 0, .max = 3600, .help = "Maximum time between two meshes of an object in training"});
  fields.Add("probe_interval_steps", &c.probe_interval_steps,
             {.unit = "steps",
              .min = 10,
              .max = 10000,
              .help = "Number of steps between comparisons of the field with its views"});
  fields.Add("min_loss_decrease", &c.min_loss_decrease,
             {.min = 0,
              .max = 1,
              .help = "Minimum relative decrease of the loss over 100 steps that extends a complete training"});
  fields.Add("max_extra_steps", &c.max_extra_steps,
             {.unit = "steps",
              .min = 0,
              .max = 100000,
              .help = "Maximum extension of a complete training since the last change of views or box; 0 = none"});
  fields.Add("max_training_time_s", &c.max_training_time_s,
             {.unit = "s",
              .min = 0,
              .max = 86400,
              .audience = Audience::kOperator,
              .help = "Maximum CPU time for training an object, summed over its threads"});
  fields.Add("max_training_time_per_view_s", &c.max_training_time_per_view_s,
             {.unit = "s", .min = 0, .max = 3600, .help = "Addition to max_training_time_s for each view"});
  fields.Add("completion_delay_s", &c.completion_delay_s,
             {.unit = "s", .min = 0, .max = 3600, .help = "Time without a new view after which training is completed"});
  fields.Add(
      "pose_prior_px", &c.pose_prior_px,
      {.unit = "px",
       .min = 0,
       .max = 100,
       .help = "Expected maximum error of the camera poses, for their refinement during training; 0 = no refinement"});
}

// What the CUDA kernels support; see server/nerf/cuda/cuda_trainer.h.
void ValidateForCuda(const NerfConfig& c, ConfigRules& rules) {
  constexpr int kMaxHiddenWidth = 128;
  if (c.backend != "cuda") return;
  rules.Forbid(c.field != "density", &c.backend, "does not support", &c.field, "it supports density");
  rules.Forbid(c.encoding != "hash", &c.backend, "does not support", &c.encoding, "it supports hash");
  rules.Forbid(c.hidden_layers != 1, &c.backend, "does not support", &c.hidden_layers, "it supports 1");
  rules.Forbid(c.hidden_width > kMaxHiddenWidth, &c.backend, "does not support", &c.hidden_width,
               fmt::format("it supports at most {}", kMaxHiddenWidth));
}

}  // namespace

void NerfConfig::Fields(ConfigFields& fields) {
  FieldFields(*this, fields);
  SpaceFields(*this, fields);
  RayFields(*this, fields);
  LossFields(*this, fields);
  OptimizerFields(*this, fields);
  ScheduleFields(*this, fields);
  fields.AddRules([this](ConfigRules& rules) { Validate(rules); });
}

void NerfConfig::Validate(ConfigRules& rules) const {
  rules.RequireAtMost(&base_resolution, &finest_resolution);
  rules.RequireAtMost(&min_samples_per_ray, &max_samples_per_ray);
  rules.Forbid(background_share + sparse_depth_share >= 1, &background_share, "leaves no object rays with",
               &sparse_depth_share, "their sum must be below 1");
  rules.RequireAtMost(&initial_sharpness, &final_sharpness);
  rules.RequireAtMost(&final_learning_rate, &learning_rate);
  rules.RequireAtMost(&first_budget_steps, &full_budget_steps);
  rules.RequireAtMost(&refine_steps_per_view, &max_refine_steps);
  ValidateForCuda(*this, rules);
}

}  // namespace romap::nerf
