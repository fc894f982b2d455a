#pragma once

#include "common/config.h"

namespace romap::mesh {

// How a trained field becomes a triangle mesh.
struct MeshConfig {
  int resolution = 64;
  bool adapt_resolution = true;
  double pixels_per_node = 2.5;
  int min_side_nodes = 48;
  double min_confirmed_share = 0.25;
  bool fill_unseen = true;
  bool cut_below_support = true;
  double min_component_share = 0.35;
  bool trim_unseen = false;
  double trim_confidence = 0.1;

  void Fields(ConfigFields& fields) {
    fields.Add(
        "resolution", &resolution,
        {.unit = "nodes", .min = 8, .max = 256, .help = "Grid nodes along the longest side of the object's box"});
    fields.Add("adapt_resolution", &adapt_resolution,
               {.help = "Half to (when training is done) twice as many nodes, by the size in the views"});
    fields.Add("pixels_per_node", &pixels_per_node,
               {.unit = "px", .min = 0.5, .max = 50, .help = "Size in a good view that earns a node, when adapting"});
    fields.Add("min_side_nodes", &min_side_nodes,
               {.unit = "nodes", .min = 2, .max = 256, .help = "Least nodes along the short sides of flat boxes"});
    fields.Add("min_confirmed_share", &min_confirmed_share,
               {.min = 0, .max = 1, .help = "Where a smaller share of the views shows the object there is nothing"});
    fields.Add("fill_unseen", &fill_unseen,
               {.help = "Empty space that no training view can see becomes solid (undersides, insides)"});
    fields.Add("cut_below_support", &cut_below_support,
               {.help = "The object ends at the lowest height where a training view sees its surface"});
    fields.Add("min_component_share", &min_component_share,
               {.min = 0, .max = 1, .help = "A separate piece smaller than this share of the largest is a floater"});
    fields.Add("trim_unseen", &trim_unseen,
               {.help = "Leave out surface that no training view saw; the mesh is then open"});
    fields.Add("trim_confidence", &trim_confidence,
               {.min = 0, .max = 1, .help = "Confidence below which trim_unseen takes a vertex for unseen"});
  }
};

}  // namespace romap::mesh
