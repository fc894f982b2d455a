#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

namespace romap::slam {

// 256 bits of an ORB descriptor (Rublee et al., ICCV 2011).
using Descriptor = std::array<uint64_t, 4>;

// Two descriptors match when their distance is at most this (of 256 bits) and below this share of the distance to the
// second best match.
inline constexpr int kMaxMatchDistance_bits = 60;
inline constexpr double kMaxMatchRatio = 0.8;

// Number of differing bits. Without an instruction that counts bits, which not every x86-64 has, std::popcount calls a
// function for each word. Here all words are counted in parallel: in pairs of bits, then in groups of 4, 8 and 16.
inline int HammingDistance(const Descriptor& a, const Descriptor& b) {
  constexpr uint64_t kMask2 = 0x5555555555555555, kMask4 = 0x3333333333333333;
  constexpr uint64_t kMask8 = 0x0f0f0f0f0f0f0f0f, kMask16 = 0x00ff00ff00ff00ff;
  uint64_t sums_of_8 = 0;
  for (size_t i = 0; i < a.size(); i += 2) {
    uint64_t sums_of_4 = 0;
    for (size_t word = i; word < i + 2; ++word) {
      const uint64_t differing = a[word] ^ b[word];
      const uint64_t sums_of_2 = differing - ((differing >> 1) & kMask2);
      sums_of_4 += (sums_of_2 & kMask4) + ((sums_of_2 >> 2) & kMask4);
    }
    sums_of_8 += (sums_of_4 & kMask8) + ((sums_of_4 >> 4) & kMask8);
  }
  const uint64_t sums_of_16 = (sums_of_8 & kMask16) + ((sums_of_8 >> 8) & kMask16);
  return static_cast<int>((sums_of_16 * 0x0001000100010001) >> 48);
}

// Ratio of the sizes of successive octaves of the image pyramid.
inline constexpr double kOctaveFactor = 1.2;
inline constexpr int kOctaves = 8;
inline constexpr double kMaxOctaveScale = 3.58;  // kOctaveFactor ^ (kOctaves - 1)

// A corner of one frame.
struct Feature {
  Eigen::Vector2f pixel_px;  // in the pinhole image of Frame::camera, for all lens models
  int octave = 0;            // pyramid level of the detection, 0 = full size
  double octave_scale = 1;   // kOctaveFactor ^ octave
  float angle_rad = 0;       // of its patch, from the image's +x axis toward +y (clockwise), -pi..pi
  uint16_t label = 0;        // of the mask at the pixel; 0 = none, or too close to the mask's border
  Descriptor descriptor{};
};

}  // namespace romap::slam
