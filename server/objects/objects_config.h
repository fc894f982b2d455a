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
  double match_min_score = 0.3;
  double mask_patience_s = 1.5;

  int confirm_frames = 6;
  int confirm_keyframes = 3;
  double confirm_parallax_deg = 10;
  double confirm_seen_share = 0.2;
  double confirm_agreement = 0.5;
  int provisional_patience_frames = 40;
  int lost_after_frames = 90;

  int hull_cells = 20;
  int max_silhouettes = 36;
  double silhouette_angle_deg = 3;
  int fits_per_keyframe = 1;
  int min_object_points = 8;
  std::string outlier_removal = "hull_and_forest";
  std::string cuboid_from = "silhouettes";
  double edge_yaw_min_confidence = 0.25;
  int edge_searches_per_keyframe = 1;

  double update_change_share = 0.02;
  double update_yaw_deg = 2;

  double view_angle_deg = 13;
  double first_view_angle_deg = 5;
  int first_views = 4;
  int max_views = 40;
  double view_min_sharpness_share = 0.6;
  int max_waiting_keyframes = 24;

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
    fields.Add("match_min_score", &match_min_score,
               {.min = 0, .max = 1, .help = "Least association score between a detection and an object"});
    fields.Add("mask_patience_s", &mask_patience_s,
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
    fields.Add("confirm_agreement", &confirm_agreement,
               {.min = 0,
                .max = 1,
                .help = "Least mean agreement of an object's masks with its shape before it is "
                        "announced"});
    fields.Add("provisional_patience_frames", &provisional_patience_frames,
               {.unit = "frames", .min = 1, .max = 10000, .help = "An unconfirmed object dies after so long unseen"});
    fields.Add("lost_after_frames", &lost_after_frames,
               {.unit = "frames", .min = 1, .max = 100000, .help = "Missed in plain view so often, an object is lost"});
    fields.Add("hull_cells", &hull_cells,
               {.unit = "cells", .min = 16, .max = 96, .help = "Cells along each side of the visual hull's grid"});
    fields.Add("max_silhouettes", &max_silhouettes,
               {.unit = "keyframes", .min = 4, .max = 200, .help = "Masks that carve one object's hull"});
    fields.Add("silhouette_angle_deg", &silhouette_angle_deg,
               {.unit = "deg", .min = 0, .max = 30, .help = "Masks from directions closer than this are redundant"});
    fields.Add("fits_per_keyframe", &fits_per_keyframe,
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
    fields.Add("edge_searches_per_keyframe", &edge_searches_per_keyframe,
               {.unit = "masks", .min = 0, .max = 254, .help = "On so many masks of a keyframe edges are looked for"});
    fields.Add("update_change_share", &update_change_share,
               {.min = 0, .max = 0.5, .help = "A cuboid is sent anew when it changed by this share of its size"});
    fields.Add("update_yaw_deg", &update_yaw_deg,
               {.unit = "deg", .min = 0, .max = 45, .help = "A cuboid is sent anew when it turned by more"});
    fields.Add("view_angle_deg", &view_angle_deg,
               {.unit = "deg",
                .min = 1,
                .max = 90,
                .help = "A keyframe becomes a training view when it differs by more from all others (paper: 25)"});
    fields.Add("first_view_angle_deg", &first_view_angle_deg,
               {.unit = "deg", .min = 1, .max = 90, .help = "The same for the first views of an object"});
    fields.Add("first_views", &first_views,
               {.unit = "views", .min = 0, .max = 100, .help = "So many views count as the first"});
    fields.Add("max_views", &max_views, {.unit = "views", .min = 2, .max = 500, .help = "Training views per object"});
    fields.Add("view_min_sharpness_share", &view_min_sharpness_share,
               {.min = 0, .max = 1, .help = "Blurrier than this share of the object's median: wait for a better one"});
    fields.Add("max_waiting_keyframes", &max_waiting_keyframes,
               {.unit = "keyframes", .min = 1, .max = 200, .help = "Keyframes kept until an object has a cuboid"});
  }
};

}  // namespace romap::objects
