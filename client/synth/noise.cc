#include "client/synth/noise.h"

#include <algorithm>
#include <cmath>

namespace romap::synth {
namespace {

float Fade(float t) { return t * t * t * (t * (t * 6 - 15) + 10); }

// Faster than std::lerp, which guarantees exact end points; this is the innermost loop of all textures.
float Lerp(float a, float b, float t) { return a + t * (b - a); }

// Dot product with one of the twelve edge directions of a cube, selected by the low bits of `hash`.
float GradientDot(uint32_t hash, float x, float y, float z) {
  const uint32_t h = hash & 15U;
  const float u = h < 8 ? x : y;
  const float v = h < 4 ? y : (h == 12 || h == 14 ? x : z);
  return ((h & 1U) != 0 ? -u : u) + ((h & 2U) != 0 ? -v : v);
}

}  // namespace

uint32_t CellHash(int32_t x, int32_t y, int32_t z, uint32_t seed) {
  uint32_t h = seed * 0x9E3779B1U + static_cast<uint32_t>(x) * 0x85EBCA77U + static_cast<uint32_t>(y) * 0xC2B2AE3DU +
               static_cast<uint32_t>(z) * 0x27D4EB2FU;
  h = (h ^ (h >> 15)) * 0x2C1B3C6DU;
  h = (h ^ (h >> 12)) * 0x297A2D39U;
  return h ^ (h >> 15);
}

float CellUniform(int32_t x, int32_t y, int32_t z, uint32_t seed) {
  return static_cast<float>(CellHash(x, y, z, seed) >> 8) * 0x1.0p-24F;
}

float GradientNoise(const Eigen::Vector3f& p, uint32_t seed) {
  const float fx = std::floor(p.x());
  const float fy = std::floor(p.y());
  const float fz = std::floor(p.z());
  const auto ix = static_cast<int32_t>(fx);
  const auto iy = static_cast<int32_t>(fy);
  const auto iz = static_cast<int32_t>(fz);
  const float x = p.x() - fx;
  const float y = p.y() - fy;
  const float z = p.z() - fz;
  const float u = Fade(x);
  const float v = Fade(y);
  float layers[2];
  for (int k = 0; k < 2; ++k) {
    const float dz = z - static_cast<float>(k);
    const float n00 = GradientDot(CellHash(ix, iy, iz + k, seed), x, y, dz);
    const float n10 = GradientDot(CellHash(ix + 1, iy, iz + k, seed), x - 1, y, dz);
    const float n01 = GradientDot(CellHash(ix, iy + 1, iz + k, seed), x, y - 1, dz);
    const float n11 = GradientDot(CellHash(ix + 1, iy + 1, iz + k, seed), x - 1, y - 1, dz);
    layers[k] = Lerp(Lerp(n00, n10, u), Lerp(n01, n11, u), v);
  }
  return Lerp(layers[0], layers[1], Fade(z));
}

float Resolved(float feature_m, float footprint_m) {
  return std::clamp(feature_m / (2 * footprint_m) - 0.5F, 0.0F, 1.0F);
}

float FractalNoise(const Eigen::Vector3f& p_m, float wavelength_m, int octaves, float persistence, float footprint_m,
                   uint32_t seed) {
  float sum = 0;
  float amplitude = 1;
  float amplitude_sum = 0;
  for (int octave = 0; octave < octaves; ++octave) {
    const float visible = Resolved(wavelength_m, footprint_m);
    amplitude_sum += amplitude;
    if (visible > 0) {
      // The offset separates the lattice points of the octaves, where the noise is zero.
      const Eigen::Vector3f offset = Eigen::Vector3f::Constant(17.37F * static_cast<float>(octave));
      sum += amplitude * visible * GradientNoise(p_m / wavelength_m + offset, seed + static_cast<uint32_t>(octave));
    }
    wavelength_m *= 0.5F;
    amplitude *= persistence;
  }
  // Gradient noise rarely exceeds 0.7.
  return 1.4F * sum / amplitude_sum;
}

}  // namespace romap::synth
