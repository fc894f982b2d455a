#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <cstdint>

namespace romap {

// 256 bits of an ORB descriptor (Rublee et al., ICCV 2011).
using Descriptor = std::array<uint64_t, 4>;

inline int HammingDistance(const Descriptor& a, const Descriptor& b) {
  int distance = 0;
  for (size_t i = 0; i < a.size(); ++i) distance += std::popcount(a[i] ^ b[i]);
  return distance;
}

// Each octave of the image pyramid is this much smaller than the one before.
inline constexpr double kOctaveFactor = 1.2;
inline constexpr int kOctaves = 8;

// A corner of one frame.
struct Feature {
  Eigen::Vector2f pixel_px;  // in the pinhole image of Frame::camera, whatever the lens
  int octave = 0;            // pyramid level it was found on, 0 = full size
  double octave_scale = 1;   // kOctaveFactor ^ octave
  float angle_rad = 0;       // of its patch: from the image's +x towards +y (clockwise as seen), -pi..pi
  uint16_t label = 0;        // of the mask under it; 0 = none, or too close to the mask's border to tell
  Descriptor descriptor{};
};

}  // namespace romap
