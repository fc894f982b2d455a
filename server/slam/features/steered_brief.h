#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "server/slam/features/feature.h"

namespace romap::slam {

// Radius of the patch for orientation and descriptor. Corners closer to the image's edge than kPatchBorder_px, which
// includes a margin for rounding, have no descriptor.
inline constexpr int kPatchRadius_px = 15;
inline constexpr int kPatchBorder_px = kPatchRadius_px + 1;

// Direction of a patch, as a unit vector (cosine, sine) in the image, x right and y down.
struct PatchDirection {
  float cosine = 1;
  float sine = 0;
};

// Direction from the corner to the centroid of the gray values in the circle around it (intensity centroid, Rosin 1999,
// as used by Rublee et al., ICCV 2011). `image` is CV_8UC1; the pixel lies at least kPatchBorder_px inside it.
PatchDirection IntensityCentroid(const cv::Mat& image, int x_px, int y_px);

// One binary test: the bit is set when the gray value at the first point is less than that at the second. Offsets from
// the corner, in pixels, for the direction (1, 0).
struct BriefTest {
  int8_t first_x_px = 0;
  int8_t first_y_px = 0;
  int8_t second_x_px = 0;
  int8_t second_y_px = 0;
};

// The 256 tests, learned to be discriminative and uncorrelated; bit i of the descriptor is bit (i % 64) of its word (i
// / 64).
const std::array<BriefTest, 256>& BriefTests();

// Results of the tests with the pattern rotated to the direction of the patch (steered BRIEF, Rublee et al., ICCV
// 2011). `smooth` is CV_8UC1, blurred; the pixel lies at least kPatchBorder_px inside it.
Descriptor SteeredBrief(const cv::Mat& smooth, int x_px, int y_px, const PatchDirection& direction);

}  // namespace romap::slam
