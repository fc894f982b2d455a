#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "client/synth/random.h"

namespace romap::synth {

using Rgb = Eigen::Vector3f;  // linear intensity, 0..1

enum class Pattern {
  kPlain,    // one color with weak grain
  kSpeckle,  // clouds and specks, like glazed stoneware
  kStripes,  // bands across z, slightly wavy
  kChecks,   // three-dimensional checkerboard
  kDots,     // spheres in a cubic lattice, intersected by the surface
  kWood,     // growth rings along x
  kMarble,   // veins
  kFabric,   // woven threads under clouds of dye
  kPrint,    // printed pages: text, headings and images
  kPages,    // edge of a stack of sheets: thin lines across z
  kTiles,    // square tiles of different tints with joints
  kLeaf,     // mottled green with veins
};

// Mapping of the flat pattern kPrint to a solid: projected along the dominant axis of the normal, or wrapped around z.
enum class Wrapping { kBox, kCylinder };

// A solid texture: assigns a color to each point in the frame of a part.
struct Material {
  Pattern pattern = Pattern::kPlain;
  std::array<Rgb, 3> colors = {Rgb::Constant(0.6F), Rgb::Constant(0.3F), Rgb::Constant(0.1F)};
  float scale_m = 0.02F;  // size of the main feature of the pattern
  float grain = 0.1F;     // strength of the fine noise added to the pattern, 0..1
  uint32_t seed = 0;
  Wrapping wrapping = Wrapping::kBox;
  Eigen::Vector2f period_m = Eigen::Vector2f::Zero();  // the texture repeats in x and y with this period; 0 = never
};

// The color at `p_local_m` on a surface with unit normal `n_local`, filtered for a pixel that covers a side length of
// `footprint_m` on the surface.
Rgb Albedo(const Material& material, const Eigen::Vector3f& p_local_m, const Eigen::Vector3f& n_local,
           float footprint_m);

// Converts an sRGB color, given as hue, saturation and value in 0..1, to linear intensity.
Rgb FromHsv(double hue, double saturation, double value);
// A material with random, clearly different colors.
Material RandomMaterial(Pattern pattern, float scale_m, Random& random);

}  // namespace romap::synth
