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
    DetectionFields(fields);
    ConfirmationFields(fields);
    CuboidFields(fields);
    ViewFields(fields);
    fields.AddRules([this](ConfigRules& rules) { Validate(rules); });
  }

  void Validate(ConfigRules& rules) const {
    rules.RequireAtMost(&confirm_keyframes, &confirm_frames);
    rules.RequireAtMost(&first_view_angle_deg, &view_angle_deg);
    rules.RequireAtMost(&first_views, &max_views);
  }

 private:
  void DetectionFields(ConfigFields& fields) {
    fields.Add(
        "min_mask_area_px", &min_mask_area_px,
        {.unit = "px", .min = 4, .max = 1e6, .help = "Minimum number of pixels of a mask; smaller masks are ignored"});
    fields.Add("max_mask_area_share", &max_mask_area_share,
               {.min = 0.05, .max = 1, .help = "Maximum share of the image under a mask; larger masks are ignored"});
    fields.Add("max_detections", &max_detections,
               {.unit = "masks",
                .min = 1,
                .max = 254,
                .help = "Maximum number of masks used per frame; beyond it, the smallest masks are ignored"});
    fields.Add("association", &association,
               {.choices = {"scored", "greedy_iou"},
                .help = "Matching of masks to objects: best assignment by all evidence, or greedy by the overlap of "
                        "boxes (paper)"});
    fields.Add("max_mask_delay_s", &max_mask_delay_s,
               {.unit = "s",
                .min = 0,
                .max = 10,
                .audience = Audience::kOperator,
                .help = "Maximum age of a frame, relative to the newest frame, when its masks arrive; masks of older "
                        "frames are rejected"});
  }

  void ConfirmationFields(ConfigFields& fields) {
    fields.Add("confirm_frames", &confirm_frames,
               {.unit = "frames",
                .min = 1,
                .max = 1000,
                .help = "Minimum number of detections of a confirmed object; it is announced as provisional after 3"});
    fields.Add("confirm_keyframes", &confirm_keyframes,
               {.unit = "keyframes",
                .min = 2,
                .max = 100,
                .help = "Minimum number of detections of a confirmed object in keyframes"});
    fields.Add("confirm_parallax_deg", &confirm_parallax_deg,
               {.unit = "deg",
                .min = 1,
                .max = 90,
                .help = "Minimum range of viewing directions of a confirmed object; 1.5 times as large if it has fewer "
                        "than min_object_points map points"});
    fields.Add("confirm_seen_share", &confirm_seen_share,
               {.min = 0,
                .max = 1,
                .help = "Minimum share of detections in the frames that should show the object; below it, an object is "
                        "not confirmed, and removed when lost"});
    fields.Add("lost_after_frames", &lost_after_frames,
               {.unit = "frames",
                .min = 1,
                .max = 100000,
                .help = "A confirmed object is lost after this many missed detections in frames that should show it"});
  }

  void CuboidFields(ConfigFields& fields) {
    fields.Add("max_silhouettes", &max_silhouettes,
               {.unit = "masks",
                .min = 4,
                .max = 200,
                .help = "Maximum number of masks that carve the visual hull of an object"});
    fields.Add("silhouette_angle_deg", &silhouette_angle_deg,
               {.unit = "deg",
                .min = 0,
                .max = 30,
                .help = "Minimum angle between the viewing directions of two masks that carve a visual hull"});
    fields.Add("cuboid_fits_per_keyframe", &cuboid_fits_per_keyframe,
               {.unit = "objects",
                .min = 1,
                .max = 1000,
                .help = "Maximum number of cuboids that are fitted per keyframe; the others wait"});
    fields.Add("min_object_points", &min_object_points,
               {.unit = "points", .min = 3, .max = 1000, .help = "Minimum number of map points that locate an object"});
    fields.Add("outlier_removal", &outlier_removal,
               {.choices = {"hull_and_forest", "forest", "none"},
                .help = "Map points under the masks of an object that are assigned to the background: those outside "
                        "its visual hull and those rejected by an isolation forest"});
    fields.Add(
        "cuboid_from", &cuboid_from,
        {.choices = {"silhouettes", "points"},
         .help = "Evidence that bounds a cuboid: masks, points and the support surface, or points only (paper)"});
    fields.Add("edge_yaw_min_confidence", &edge_yaw_min_confidence,
               {.min = 0,
                .max = 1,
                .help = "Minimum confidence of the straight edges that determine the yaw of a cuboid; 1 = edges are "
                        "not used"});
  }

  void ViewFields(ConfigFields& fields) {
    fields.Add("view_angle_deg", &view_angle_deg,
               {.unit = "deg",
                .min = 1,
                .max = 90,
                .help = "Minimum angle between the viewing directions of two training views (paper: 25)"});
    fields.Add("first_view_angle_deg", &first_view_angle_deg,
               {.unit = "deg", .min = 1, .max = 90, .help = "Minimum angle for the first training views of an object"});
    fields.Add("first_views", &first_views,
               {.unit = "views", .min = 0, .max = 100, .help = "Number of views that use first_view_angle_deg"});
    fields.Add("max_views", &max_views,
               {.unit = "views",
                .min = 2,
                .max = 255,
                .audience = Audience::kOperator,
                .help = "Maximum number of training views per object"});
  }
};

}  // namespace romap::objects
