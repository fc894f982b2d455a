#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "client/synth/random.h"

namespace romap::synth {

using Rgb = Eigen::Vector3f;  // linear light, 0..1

enum class Pattern {
  kPlain,    // one colour with a hint of grain: weakly textured
  kSpeckle,  // glazed stoneware: clouds and specks
  kStripes,  // bands across z, slightly wavy
  kChecks,   // chequered in three dimensions
  kDots,     // spheres in a cubic lattice, cut by the surface
  kWood,     // growth rings along x
  kMarble,   // veins
  kFabric,   // woven threads under clouds of dye
  kPrint,    // printed matter: columns of words, headings and pictures
  kPages,    // the edge of a stack of sheets, thin lines across z
  kTiles,    // square tiles with joints, each of its own tint
  kLeaf,     // mottled green with veins
};

// How the flat pattern kPrint is laid over a solid: seen along the main axis of the normal, or around the z axis.
enum class Wrapping { kBox, kCylinder };

// A solid texture: the colour of each point of space, in the frame of the part that is made of it.
struct Material {
  Pattern pattern = Pattern::kPlain;
  std::array<Rgb, 3> colors = {Rgb::Constant(0.6F), Rgb::Constant(0.3F), Rgb::Constant(0.1F)};
  float scale_m = 0.02F;  // size of the pattern's main feature
  float grain = 0.1F;     // strength of fine noise over all patterns, 0..1
  uint32_t seed = 0;
  Wrapping wrapping = Wrapping::kBox;
};

// Colour at `p_local_m` on a surface with unit normal `n_local`, averaged as far as a pixel of `footprint_m` (its side
// on the surface) demands.
Rgb Albedo(const Material& material, const Eigen::Vector3f& p_local_m, const Eigen::Vector3f& n_local,
           float footprint_m);

// Linear colour of hue 0..1, saturation 0..1, value 0..1 (as sRGB).
Rgb FromHsv(double hue, double saturation, double value);
// A material of the pattern in random colours that differ well from each other.
Material RandomMaterial(Pattern pattern, float scale_m, Random& random);

}  // namespace romap::synth
