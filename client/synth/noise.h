#pragma once

#include <Eigen/Core>
#include <cstdint>

namespace romap::synth {

// Hash of a lattice cell to 32 bits.
uint32_t CellHash(int32_t x, int32_t y, int32_t z, uint32_t seed);
// The same as a number in [0, 1).
float CellUniform(int32_t x, int32_t y, int32_t z, uint32_t seed);

// Gradient noise with period-free unit lattice, about -1..1 (Perlin, "Improving noise", 2002).
float GradientNoise(const Eigen::Vector3f& p, uint32_t seed);

// Sum of octaves of gradient noise, the coarsest of wavelength `wavelength_m`, each next one half as long and
// `persistence` as strong; about -1..1. Octaves too fine for a pixel of `footprint_m` fade out, so that no pixel shows
// a random sample of detail it cannot resolve.
float FractalNoise(const Eigen::Vector3f& p_m, float wavelength_m, int octaves, float persistence, float footprint_m,
                   uint32_t seed);

// 1 where a feature of size `feature_m` is resolved by pixels of `footprint_m`, falling to 0 where it is not.
float Resolved(float feature_m, float footprint_m);

}  // namespace romap::synth
