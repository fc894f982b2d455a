#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace romap::synth {

// Hash of a lattice cell to 32 bits.
uint32_t CellHash(int32_t x, int32_t y, int32_t z, uint32_t seed);
// CellHash as a number in [0, 1).
float CellUniform(int32_t x, int32_t y, int32_t z, uint32_t seed);

// Gradient noise on an unbounded unit lattice, about -1..1 (Perlin, "Improving noise", 2002).
float GradientNoise(const Eigen::Vector3f& p, uint32_t seed);

// Sum of octaves of gradient noise, about -1..1. The first octave has wavelength `wavelength_m`; each next one has half
// the wavelength and `persistence` times the amplitude. Octaves that pixels of `footprint_m` cannot resolve fade out,
// which avoids aliasing.
float FractalNoise(const Eigen::Vector3f& p_m, float wavelength_m, int octaves, float persistence, float footprint_m,
                   uint32_t seed);

// 1 if pixels of `footprint_m` resolve a feature of size `feature_m`, decreasing to 0 if they do not.
float Resolved(float feature_m, float footprint_m);

}  // namespace romap::synth
