#pragma once

#include <string>

#include "common/config.h"

namespace romap::objects {

// Object mapping: from masks and sparse points to landmarks, cuboids and training views.
struct ObjectsConfig {
  int min_mask_area_px = 120;
  double max_mask_area_share = 0.6;
  int max_detections = 200;
  std::string association = "scored";
  double max_mask_delay_s = 1.5;

  int confirm_frames = 6;
  int confirm_keyframes = 3;
  double confirm_parallax_deg = 10;
  double confirm_seen_share = 0.2;
  int lost_after_frames = 90;

  int max_silhouettes = 36;
  double silhouette_angle_deg = 3;
  int cuboid_fits_per_keyframe = 1;
  int min_object_points = 8;
  std::string outlier_removal = "hull_and_forest";
  std::string cuboid_from = "silhouettes";
  double edge_yaw_min_confidence = 0.25;

  double view_angle_deg = 13;
  double first_view_angle_deg = 5;
  int first_views = 4;
  int max_views = 40;

  void Fields(ConfigFields& fields) {
    fields.Section("objects");
    fields.Add("min_mask_area_px", &min_mask_area_px,
               {.unit = "px", .min = 4, .max = 1e6, .help = "Smaller masks are ignored"});
    fields.Add("max_mask_area_share", &max_mask_area_share,
               {.min = 0.05, .max = 1, .help = "Masks that fill more of the image are ignored"});
    fields.Add("max_detections", &max_detections,
               {.unit = "masks", .min = 1, .max = 254, .help = "Of more masks in one frame the largest are used"});
    fields.Add("association", &association,
               {.choices = {"scored", "greedy_iou"},
                .help = "Masks to objects: all evidence and the best assignment, or the paper's overlap of boxes"});
    fields.Add("max_mask_delay_s", &max_mask_delay_s,
               {.unit = "s", .min = 0, .max = 10, .help = "Masks may come so long after their frame"});
    fields.Add("confirm_frames", &confirm_frames,
               {.unit = "frames", .min = 1, .max = 1000, .help = "Sightings before an object is announced"});
    fields.Add("confirm_keyframes", &confirm_keyframes,
               {.unit = "keyframes", .min = 2, .max = 100, .help = "Keyframe sightings before an object is announced"});
    fields.Add("confirm_parallax_deg", &confirm_parallax_deg,
               {.unit = "deg", .min = 1, .max = 90, .help = "Change of direction before an object is announced"});
    fields.Add("confirm_seen_share", &confirm_seen_share,
               {.min = 0,
                .max = 1,
                .help = "An object is a ghost when it is seen in a smaller share of the frames that "
                        "ought to show it"});
    fields.Add("lost_after_frames", &lost_after_frames,
               {.unit = "frames", .min = 1, .max = 100000, .help = "Missed in plain view so often, an object is lost"});
    fields.Add("max_silhouettes", &max_silhouettes,
               {.unit = "keyframes", .min = 4, .max = 200, .help = "Masks that carve one object's hull"});
    fields.Add("silhouette_angle_deg", &silhouette_angle_deg,
               {.unit = "deg", .min = 0, .max = 30, .help = "Masks from directions closer than this are redundant"});
    fields.Add("cuboid_fits_per_keyframe", &cuboid_fits_per_keyframe,
               {.unit = "objects",
                .min = 1,
                .max = 1000,
                .help = "So many objects get new cuboids at a keyframe; the others wait for their turn"});
    fields.Add("min_object_points", &min_object_points,
               {.unit = "points", .min = 3, .max = 1000, .help = "Fewer map points do not say where an object is"});
    fields.Add("outlier_removal", &outlier_removal,
               {.choices = {"hull_and_forest", "forest", "none"},
                .help = "Which map points under a mask are taken for the background's: those outside the visual hull, "
                        "lonely ones"});
    fields.Add("cuboid_from", &cuboid_from,
               {.choices = {"silhouettes", "points"},
                .help = "What bounds a cuboid: masks, points and the support together, or the paper's extreme points"});
    fields.Add("edge_yaw_min_confidence", &edge_yaw_min_confidence,
               {.min = 0, .max = 1, .help = "Straight edges that agree so well decide a cuboid's yaw; 1 = never"});
    fields.Add("view_angle_deg", &view_angle_deg,
               {.unit = "deg",
                .min = 1,
                .max = 90,
                .help = "A keyframe becomes a training view when it differs by more from all others (paper: 25)"});
    fields.Add("first_view_angle_deg", &first_view_angle_deg,
               {.unit = "deg", .min = 1, .max = 90, .help = "The same for the first views of an object"});
    fields.Add("first_views", &first_views,
               {.unit = "views", .min = 0, .max = 100, .help = "So many views count as the first"});
    fields.Add("max_views", &max_views, {.unit = "views", .min = 2, .max = 255, .help = "Training views per object"});
  }
};

}  // namespace romap::objects
