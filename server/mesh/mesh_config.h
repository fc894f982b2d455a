#pragma once

#include "common/config.h"

namespace romap {

// How a trained field becomes a triangle mesh.
struct MeshConfig {
  int resolution = 64;
  bool fill_unseen = true;
  double unseen_optical_depth = 0.2;
  bool cut_below_support = true;
  double min_component_share = 0.35;

  void Fields(ConfigFields& fields) {
    fields.Add("resolution", &resolution,
               {.unit = "nodes", .min = 8, .max = 256, .help = "Grid nodes along each side of the object's box"});
    fields.Add("fill_unseen", &fill_unseen,
               {.help = "Empty space that no training view can see becomes solid (undersides, insides)"});
    fields.Add("unseen_optical_depth", &unseen_optical_depth,
               {.min = 0.01, .max = 100, .help = "Optical depth towards a view beyond which it sees nothing"});
    fields.Add("cut_below_support", &cut_below_support,
               {.help = "The object ends at the lowest height where a training view sees its surface"});
    fields.Add("min_component_share", &min_component_share,
               {.min = 0, .max = 1, .help = "A separate piece smaller than this share of the largest is a floater"});
  }
};

}  // namespace romap
