#pragma once

#include "common/config.h"

namespace romap::slam {

// When a frame becomes a keyframe, and how keyframes become a sparse map.
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
  int max_points = 20000;
  double min_parallax_deg = 2.0;
  double pixel_sigma_px = 1.0;
  double depth_sigma_ratio = 0.02;
  double prior_sigma_rad = 0.01;
  double prior_sigma_mu = 0.02;
  int seed = 1;

  void Fields(ConfigFields& fields) {
    KeyframeFields(fields);
    FeatureFields(fields);
    MapFields(fields);
  }

  // For the random samples of one call; `call` tells calls apart.
  uint64_t Seed(uint64_t call) const { return static_cast<uint64_t>(seed) * 1000003 + call; }

 private:
  void KeyframeFields(ConfigFields& fields) {
    fields.Add("keyframe_rotation_deg", &keyframe_rotation_deg,
               {.unit = "deg", .min = 0.1, .max = 90, .help = "Turn since the last keyframe that makes a new one due"});
    fields.Add("keyframe_translation_ratio", &keyframe_translation_ratio,
               {.min = 0.001, .max = 1, .help = "Way since the last keyframe, over the scene's depth, that does so"});
    fields.Add(
        "keyframe_max_gap_frames", &keyframe_max_gap_frames,
        {.unit = "frames", .min = 1, .max = 10000, .help = "A moving camera gets a keyframe at least this often"});
  }

  void FeatureFields(ConfigFields& fields) {
    fields.Add("scene_features", &scene_features,
               {.min = 50, .max = 10000, .help = "ORB features per frame, spread over the whole image"});
    fields.Add("object_features", &object_features,
               {.min = 0, .max = 10000, .help = "Further ORB features, spread over the instance masks only"});
    fields.Add("scene_fast_threshold", &scene_fast_threshold,
               {.unit = "grey levels", .min = 1, .max = 100, .help = "Contrast of a corner anywhere"});
    fields.Add("scene_fast_min_threshold", &scene_fast_min_threshold,
               {.unit = "grey levels", .min = 1, .max = 100, .help = "The same where nothing has as much contrast"});
    fields.Add("object_fast_threshold", &object_fast_threshold,
               {.unit = "grey levels", .min = 1, .max = 100, .help = "Contrast of a corner inside an instance mask"});
    fields.Add("mask_erosion_px", &mask_erosion_px,
               {.unit = "px",
                .min = 0,
                .max = 10,
                .help = "A feature so close to its mask's border, times its octave's scale, gets no label"});
  }

  void MapFields(ConfigFields& fields) {
    fields.Add("matched_keyframes", &matched_keyframes,
               {.min = 1, .max = 20, .help = "Earlier keyframes that a new one is matched with to find new points"});
    fields.Add("window_keyframes", &window_keyframes,
               {.min = 2, .max = 60, .help = "Keyframes whose poses local bundle adjustment refines"});
    fields.Add("max_keyframes", &max_keyframes,
               {.min = 10, .max = 100000, .help = "Keyframes in the map; beyond, the least needed go"});
    fields.Add("close_loops", &close_loops, {.help = "Correct the map when a known place is seen again"});
    fields.Add("refine_lens", &refine_lens,
               {.help = "Find what the client's calibration leaves of the lens; for poses that come from images"});
    fields.Add("max_points", &max_points, {.min = 100, .max = 1e6, .help = "Map points; beyond, the stalest go"});
    fields.Add("min_parallax_deg", &min_parallax_deg,
               {.unit = "deg", .min = 0.1, .max = 30, .help = "Angle between two rays that makes a point of them"});
    fields.Add("pixel_sigma_px", &pixel_sigma_px,
               {.unit = "px", .min = 0.1, .max = 10, .help = "Standard deviation of a feature of the finest octave"});
    fields.Add("depth_sigma_ratio", &depth_sigma_ratio,
               {.min = 0.0001, .max = 1, .help = "Standard deviation of a depth image over the depth"});
    fields.Add("seed", &seed, {.min = 0, .max = 1e9, .help = "Of all random samples; same input, same seed, same map"});
    fields.Add("prior_sigma_rad", &prior_sigma_rad,
               {.unit = "rad", .min = 1e-6, .max = 3, .help = "Standard deviation of a pose that is taken as a prior"});
    fields.Add("prior_sigma_mu", &prior_sigma_mu,
               {.unit = "mu", .min = 1e-9, .max = 1e6, .help = "The same of its position"});
  }
};

}  // namespace romap::slam
