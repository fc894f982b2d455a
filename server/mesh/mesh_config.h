#pragma once

#include "common/config.h"

namespace romap::mesh {

// Extraction of a triangle mesh from a trained field.
struct MeshConfig {
  int resolution = 64;
  bool adapt_resolution = true;
  double pixels_per_node = 2.5;
  int min_side_nodes = 48;
  bool fill_unseen = true;
  bool cut_below_support = true;
  double min_component_share = 0.35;
  bool trim_unseen = false;
  double trim_confidence = 0.1;
  bool texture = true;
  int texture_triangles = 8000;
  int texture_px = 1024;

  void Fields(ConfigFields& fields) {
    GridFields(fields);
    SurfaceFields(fields);
    TextureFields(fields);
    fields.AddRules([this](ConfigRules& rules) { Validate(rules); });
  }

  void Validate(ConfigRules& rules) const { rules.RequireAtMost(&min_side_nodes, &resolution); }

 private:
  void GridFields(ConfigFields& fields) {
    fields.Add("resolution", &resolution,
               {.unit = "nodes",
                .min = 8,
                .max = 256,
                .audience = Audience::kOperator,
                .help = "Number of grid nodes along the longest side of the object's box"});
    fields.Add("adapt_resolution", &adapt_resolution,
               {.audience = Audience::kOperator,
                .help = "Scale the resolution with the size of the object in its views, by a factor of 0.5 to 1 during "
                        "training and of 0.5 to 2 after it"});
    fields.Add("pixels_per_node", &pixels_per_node,
               {.unit = "px",
                .min = 0.5,
                .max = 50,
                .help = "Spacing of the grid nodes in a well-resolved view, if adapt_resolution is on"});
    fields.Add("min_side_nodes", &min_side_nodes,
               {.unit = "nodes",
                .min = 2,
                .max = 256,
                .help = "Minimum number of grid nodes along the shorter sides of the box"});
  }

  void SurfaceFields(ConfigFields& fields) {
    fields.Add("fill_unseen", &fill_unseen,
               {.help = "Make empty space solid if it is invisible in all training views (undersides, interiors)"});
    fields.Add("cut_below_support", &cut_below_support,
               {.help = "Remove everything below the lowest height at which a training view observes the surface"});
    fields.Add(
        "min_component_share", &min_component_share,
        {.min = 0,
         .max = 1,
         .help = "Minimum size of a separate component, as a share of the largest one; smaller ones are removed"});
    fields.Add("trim_unseen", &trim_unseen,
               {.help = "Remove surface that is invisible in all training views; the mesh is then open"});
    fields.Add("trim_confidence", &trim_confidence,
               {.min = 0, .max = 1, .help = "Minimum confidence of a vertex that trim_unseen keeps"});
  }

  void TextureFields(ConfigFields& fields) {
    fields.Add("texture", &texture,
               {.audience = Audience::kOperator,
                .help = "Simplify the final mesh of an object, and give it a texture from the images; off: all "
                        "triangles, with colors of the vertices"});
    fields.Add("texture_triangles", &texture_triangles,
               {.unit = "triangles", .min = 100, .max = 1000000, .help = "Maximum number of triangles of such a mesh"});
    fields.Add("texture_px", &texture_px,
               {.unit = "px", .min = 64, .max = 8192, .help = "Maximum width and height of a texture"});
  }
};

}  // namespace romap::mesh
