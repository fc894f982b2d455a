#include "server/nerf/nerf_config.h"

#include "server/nerf/presets.h"

namespace romap::nerf {
namespace {

void FieldFields(NerfConfig& c, ConfigFields& fields) {
  fields.Add("preset", &c.preset,
             {.choices = NerfPresetNames(),
              .help = "Sets all fields below it that are not given: the fast recipe, or the paper's own",
              .on_set = [&c](const std::string& name) { c = *NerfPreset(name); }});
  fields.Add("field", &c.field,
             {.choices = {"density", "sdf"}, .help = "What the field holds: density, or signed distances (CPU only)"});
  fields.Add("encoding", &c.encoding,
             {.choices = {"hash", "frequency"}, .help = "Of positions: hash grid, or sines and cosines (baselines)"});
  fields.Add("levels", &c.levels,
             {.min = 1, .max = 16, .help = "Levels of the hash grid, two features each (paper 16); or octaves"});
  fields.Add("log2_table_entries", &c.log2_table_entries,
             {.min = 8, .max = 22, .help = "log2 of the hash table's entries per level (paper 16)"});
  fields.Add("base_resolution", &c.base_resolution,
             {.unit = "cells", .min = 2, .max = 256, .help = "Coarsest level, cells per box side"});
  fields.Add("finest_resolution", &c.finest_resolution,
             {.unit = "cells", .min = 2, .max = 16384, .help = "Finest level, cells per box side (paper 2048)"});
  fields.Add("hidden_width", &c.hidden_width,
             {.min = 16, .max = 256, .help = "Neurons of a hidden layer, rounded up to a multiple of 16 (paper 64)"});
  fields.Add("hidden_layers", &c.hidden_layers, {.min = 1, .max = 6, .help = "Hidden layers of the MLP (paper 1)"});
  fields.Add("density_bias", &c.density_bias,
             {.min = -10, .max = 10, .help = "Added to the raw density: how full space is before it is learned"});
  fields.Add("surface_level", &c.surface_level,
             {.min = -10, .max = 10, .help = "Raw density (with bias) at the surface; density = e^raw per box side"});
}

void SpaceFields(NerfConfig& c, ConfigFields& fields) {
  fields.Add("box_enlargement", &c.box_enlargement,
             {.min = 0, .max = 2, .help = "The training box is the cuboid enlarged by this share"});
  fields.Add("hull_margin", &c.hull_margin,
             {.min = 0, .max = 4, .help = "Footprint of a hull cell as a share of its circumscribed sphere"});
  fields.Add("carve_hull", &c.carve_hull, {.help = "Cells that the masks call empty are empty from the start"});
  fields.Add("hull_min_votes", &c.hull_min_votes,
             {.unit = "views", .min = 1, .max = 100, .help = "Fewest views that must call a hull cell empty"});
  fields.Add("hull_vote_share", &c.hull_vote_share,
             {.min = 0, .max = 1, .help = "Least share of the views seeing a hull cell that must call it empty"});
  fields.Add("hull_trim_share", &c.hull_trim_share,
             {.min = 0, .max = 0.2, .help = "Outermost layers in which fewer rays end are cut off the hull; 0 = none"});
  fields.Add(
      "hull_show_share", &c.hull_show_share,
      {.min = 0, .max = 1, .help = "Least share of the views seeing a hull cell that must show the object there"});
  fields.Add("occupancy_start_step", &c.occupancy_start_step,
             {.unit = "steps", .min = 0, .max = 100000, .help = "First step that narrows the occupied cells"});
  fields.Add("occupancy_interval_steps", &c.occupancy_interval_steps,
             {.unit = "steps", .min = 1, .max = 100000, .help = "Steps between updates of the occupied cells"});
  fields.Add("occupancy_decay", &c.occupancy_decay,
             {.min = 0, .max = 1, .help = "Decay of a cell's largest weight at every visit"});
  fields.Add("occupancy_threshold", &c.occupancy_threshold,
             {.min = 0, .max = 1, .help = "Cells and their neighbours above this weight are sampled"});
}

void RayFields(NerfConfig& c, ConfigFields& fields) {
  fields.Add("rays_per_step", &c.rays_per_step,
             {.unit = "rays", .min = 64, .max = 65536, .help = "Rays of one optimisation step (paper 4096)"});
  fields.Add("background_share", &c.background_share, {.min = 0, .max = 0.9, .help = "Share of background rays"});
  fields.Add("sparse_depth_share", &c.sparse_depth_share,
             {.min = 0, .max = 0.5, .help = "Most rays of a step spent on pixels with a map point"});
  fields.Add("sampling", &c.sampling,
             {.choices = {"occupied", "uniform"},
              .help = "Samples in occupied cells, or evenly between entry and exit of the box as in the paper"});
  fields.Add("max_samples_per_ray", &c.max_samples_per_ray,
             {.min = 1, .max = 64, .help = "Samples per ray (paper 32)"});
  fields.Add("min_samples_per_ray", &c.min_samples_per_ray, {.min = 1, .max = 64, .help = "Fewest samples per ray"});
  fields.Add("min_sample_spacing", &c.min_sample_spacing,
             {.unit = "box sides", .min = 1e-4, .max = 1, .help = "Samples are not set closer, down to the fewest"});
}

void LossFields(NerfConfig& c, ConfigFields& fields) {
  fields.Add("opacity_weight_object", &c.opacity_weight_object,
             {.min = 0, .max = 100, .help = "Weight of 1 - opacity on object rays"});
  fields.Add("opacity_weight_background", &c.opacity_weight_background,
             {.min = 0, .max = 100, .help = "Weight of opacity on background rays"});
  fields.Add("density_weight", &c.density_weight,
             {.min = 0, .max = 100, .help = "Weight of the density of samples on background rays (paper .01)"});
  fields.Add(
      "contrast_weight", &c.contrast_weight,
      {.min = 0, .max = 100, .help = "Weight of errors in the difference of two near pixels' colours; 0 = no pairs"});
  fields.Add("depth_weight", &c.depth_weight,
             {.min = 0, .max = 100, .help = "Weight of the depth error, box sides, on rays with depth (paper .5)"});
  fields.Add("random_background", &c.random_background,
             {.help = "Blend every ray over a random colour (the paper's L_rr)"});
  fields.Add(
      "initial_sharpness", &c.initial_sharpness,
      {.unit = "per box side", .min = 1, .max = 1000, .help = "Of surfaces at the first step, signed distances"});
  fields.Add("final_sharpness", &c.final_sharpness,
             {.unit = "per box side", .min = 10, .max = 100000, .help = "Of surfaces at the last step"});
  fields.Add("eikonal_weight", &c.eikonal_weight,
             {.min = 0, .max = 10, .help = "Weight of (|gradient| - 1)^2 of signed distances"});
  fields.Add("curvature_weight", &c.curvature_weight,
             {.min = 0, .max = 10, .help = "Weight of the squared bend of signed distances, per stencil"});
}

void ScheduleFields(NerfConfig& c, ConfigFields& fields) {
  fields.Add("learning_rate", &c.learning_rate, {.min = 1e-6, .max = 1, .help = "Adam's rate at the first step"});
  fields.Add("final_learning_rate", &c.final_learning_rate,
             {.min = 1e-7, .max = 1, .help = "Adam's rate when the planned steps are done"});
  fields.Add("adam_beta1", &c.adam_beta1, {.min = 0, .max = 0.9999, .help = "Adam's decay of the mean"});
  fields.Add("adam_beta2", &c.adam_beta2, {.min = 0, .max = 0.9999, .help = "Adam's decay of the square"});
  fields.Add("min_sample_gradient", &c.min_sample_gradient,
             {.min = 0, .max = 1, .help = "Samples with a smaller gradient are left out of the backward pass"});
  fields.Add(
      "backend", &c.backend,
      {.choices = {"auto", "cpu", "cuda"},
       .help = "Where fields are trained; auto = on a CUDA device where there is one; without one always the CPU"});
  fields.Add("min_views", &c.min_views,
             {.unit = "views", .min = 1, .max = 100, .help = "Views before training starts"});
  fields.Add("first_budget_steps", &c.first_budget_steps,
             {.unit = "steps", .min = 1, .max = 100000, .help = "Steps allowed with the fewest views"});
  fields.Add("budget_steps_per_view", &c.budget_steps_per_view,
             {.unit = "steps", .min = 0, .max = 10000, .help = "More steps allowed with each further view"});
  fields.Add("full_budget_steps", &c.full_budget_steps,
             {.unit = "steps", .min = 1, .max = 100000, .help = "Steps of a full training; more makes shapes drift"});
  fields.Add("refine_steps_per_view", &c.refine_steps_per_view,
             {.unit = "steps", .min = 0, .max = 10000, .help = "Steps added by a view that comes after that"});
  fields.Add("max_refine_steps", &c.max_refine_steps,
             {.unit = "steps", .min = 0, .max = 100000, .help = "Most such steps waiting at a time"});
  fields.Add("slice_steps", &c.slice_steps,
             {.unit = "steps", .min = 1, .max = 1000, .help = "Steps for which a worker holds an object"});
  fields.Add("snapshot_interval_steps", &c.snapshot_interval_steps,
             {.unit = "steps", .min = 1, .max = 100000, .help = "A snapshot is sent after this many steps"});
  fields.Add("snapshot_interval_s", &c.snapshot_interval_s,
             {.unit = "s", .min = 0, .max = 3600, .help = "or after this time, whichever comes first"});
  fields.Add("probe_interval_steps", &c.probe_interval_steps,
             {.unit = "steps", .min = 10, .max = 10000, .help = "Steps between looks at how well each view is met"});
  fields.Add(
      "min_loss_decrease", &c.min_loss_decrease,
      {.min = 0, .max = 1, .help = "Beyond the plan training goes on while 100 steps lower the loss by this share"});
  fields.Add(
      "max_extra_steps", &c.max_extra_steps,
      {.unit = "steps", .min = 0, .max = 100000, .help = "Most such steps since the last view or box; 0 = none"});
  fields.Add(
      "max_training_time_s", &c.max_training_time_s,
      {.unit = "s", .min = 0, .max = 86400, .help = "Longest training of an object, CPU time of all its workers"});
  fields.Add("max_training_time_per_view_s", &c.max_training_time_per_view_s,
             {.unit = "s", .min = 0, .max = 3600, .help = "and so much more for each of its views"});
  fields.Add("completion_delay_s", &c.completion_delay_s,
             {.unit = "s", .min = 0, .max = 3600, .help = "Without a new view for this long, training is completed"});
  fields.Add("pose_prior_px", &c.pose_prior_px,
             {.unit = "px",
              .min = 0,
              .max = 100,
              .help = "Views' poses are refined and believed to be off by this much at most; 0 = taken as they are"});
}

}  // namespace

void NerfConfig::Fields(ConfigFields& fields) {
  FieldFields(*this, fields);
  SpaceFields(*this, fields);
  RayFields(*this, fields);
  LossFields(*this, fields);
  ScheduleFields(*this, fields);
}

}  // namespace romap::nerf
