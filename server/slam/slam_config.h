#pragma once

#include <cstdint>

#include "common/config.h"

namespace romap::slam {

// Tracking and sparse mapping.
struct SlamConfig {
  double keyframe_rotation_deg = 3.0;
  double keyframe_translation_ratio = 0.04;
  int keyframe_max_gap_frames = 30;

  int scene_features = 1000;
  int object_features = 600;
  int scene_fast_threshold = 12;
  int scene_fast_min_threshold = 4;
  int object_fast_threshold = 5;
  int mask_erosion_px = 2;

  int matched_keyframes = 4;
  int window_keyframes = 10;
  int max_keyframes = 2000;
  bool close_loops = true;
  bool refine_lens = true;
  bool refine_observations = true;
  int max_points = 20000;
  double min_parallax_deg = 2.0;
  double pixel_sigma_px = 0.7;
  double depth_sigma_ratio = 0.02;
  double prior_sigma_rad = 0.01;
  double prior_sigma_mu = 0.02;
  int seed = 1;

  void Fields(ConfigFields& fields) {
    KeyframeFields(fields);
    FeatureFields(fields);
    MapFields(fields);
    UncertaintyFields(fields);
    fields.AddRules([this](ConfigRules& rules) { Validate(rules); });
  }

  void Validate(ConfigRules& rules) const {
    rules.RequireAtMost(&scene_fast_min_threshold, &scene_fast_threshold);
    rules.RequireAtMost(&matched_keyframes, &max_keyframes);
    rules.RequireAtMost(&window_keyframes, &max_keyframes);
  }

  // Seed of the random samples of one call; `call` distinguishes calls.
  uint64_t Seed(uint64_t call) const { return static_cast<uint64_t>(seed) * 1000003 + call; }

 private:
  void KeyframeFields(ConfigFields& fields) {
    fields.Add("keyframe_rotation_deg", &keyframe_rotation_deg,
               {.unit = "deg", .min = 0.1, .max = 90, .help = "Camera rotation that makes the next keyframe due"});
    fields.Add("keyframe_translation_ratio", &keyframe_translation_ratio,
               {.min = 0.001,
                .max = 1,
                .help = "Camera translation that makes the next keyframe due, as a share of the scene depth"});
    fields.Add(
        "keyframe_max_gap_frames", &keyframe_max_gap_frames,
        {.unit = "frames", .min = 1, .max = 10000, .help = "Maximum gap between keyframes while the camera moves"});
  }

  void FeatureFields(ConfigFields& fields) {
    fields.Add("scene_features", &scene_features,
               {.min = 50,
                .max = 10000,
                .audience = Audience::kOperator,
                .help = "Maximum number of ORB features per frame, spread over the whole image"});
    fields.Add("object_features", &object_features,
               {.min = 0,
                .max = 10000,
                .help = "Maximum number of additional ORB features per frame inside the instance masks"});
    fields.Add("scene_fast_threshold", &scene_fast_threshold,
               {.unit = "gray levels", .min = 1, .max = 100, .help = "FAST corner threshold"});
    fields.Add("scene_fast_min_threshold", &scene_fast_min_threshold,
               {.unit = "gray levels",
                .min = 1,
                .max = 100,
                .help = "FAST corner threshold in regions without corners above scene_fast_threshold"});
    fields.Add("object_fast_threshold", &object_fast_threshold,
               {.unit = "gray levels", .min = 1, .max = 100, .help = "FAST corner threshold inside instance masks"});
    fields.Add(
        "mask_erosion_px", &mask_erosion_px,
        {.unit = "px",
         .min = 0,
         .max = 10,
         .help = "Features closer to the border of their mask get no label; multiplied by their octave's scale"});
  }

  void MapFields(ConfigFields& fields) {
    fields.Add("matched_keyframes", &matched_keyframes,
               {.unit = "keyframes",
                .min = 1,
                .max = 20,
                .help = "Maximum number of earlier keyframes a new one is matched with to triangulate points; twice as "
                        "many if few points are known"});
    fields.Add(
        "window_keyframes", &window_keyframes,
        {.unit = "keyframes", .min = 2, .max = 60, .help = "Maximum number of keyframes in local bundle adjustment"});
    fields.Add("max_keyframes", &max_keyframes,
               {.unit = "keyframes",
                .min = 10,
                .max = 100000,
                .audience = Audience::kOperator,
                .help = "Maximum number of keyframes in the map; the most redundant ones above it are removed"});
    fields.Add("close_loops", &close_loops,
               {.audience = Audience::kOperator, .help = "Correct the map when the camera returns to a known place"});
    fields.Add("refine_lens", &refine_lens,
               {.help = "Estimate the residual lens distortion, if the camera is tracked from images"});
    fields.Add(
        "refine_observations", &refine_observations,
        {.help = "Align the observations of a map point to its image in one keyframe, to a fraction of a pixel"});
    fields.Add("max_points", &max_points,
               {.unit = "points",
                .min = 100,
                .max = 1e6,
                .help = "Maximum number of map points; those observed least recently are removed above it"});
    fields.Add("min_parallax_deg", &min_parallax_deg,
               {.unit = "deg", .min = 0.1, .max = 30, .help = "Minimum angle between the rays of a new map point"});
    fields.Add("seed", &seed,
               {.min = 0, .max = 1e9, .help = "Seed of all random samples; the same input and seed give the same map"});
  }

  void UncertaintyFields(ConfigFields& fields) {
    fields.Add("pixel_sigma_px", &pixel_sigma_px,
               {.unit = "px",
                .min = 0.1,
                .max = 10,
                .help = "Standard deviation of the position of a feature in the finest octave"});
    fields.Add("depth_sigma_ratio", &depth_sigma_ratio,
               {.min = 0.0001, .max = 1, .help = "Standard deviation of depth images, as a share of the depth"});
    fields.Add("prior_sigma_rad", &prior_sigma_rad,
               {.unit = "rad",
                .min = 1e-6,
                .max = 3,
                .help = "Standard deviation of the orientation of client poses that are used as priors"});
    fields.Add("prior_sigma_mu", &prior_sigma_mu,
               {.unit = "map units",
                .min = 1e-9,
                .max = 1e6,
                .help = "Standard deviation of the position of client poses that are used as priors"});
  }
};

}  // namespace romap::slam
