#include "server/slam/features/steered_brief.h"

#include <cmath>

namespace romap::slam {
namespace {

constexpr size_t kTests = 256;

// Half the width of each row of a circle of radius kPatchRadius_px. The circle is as high as it is wide, because
// otherwise all directions would be biased toward one axis.
std::array<int, kPatchRadius_px + 1> CircleRows() {
  constexpr double kRadius_px = kPatchRadius_px + 0.5;
  std::array<int, kPatchRadius_px + 1> half_width_px{};
  for (int y = 0; y <= kPatchRadius_px; ++y) {
    half_width_px[static_cast<size_t>(y)] = static_cast<int>(std::sqrt(kRadius_px * kRadius_px - y * y));
  }
  return half_width_px;
}

// The points of the tests in separate coordinate arrays, all first points before all second points, so that the
// compiler can vectorize their rotation.
struct TestPoints {
  std::array<float, 2 * kTests> x_px;
  std::array<float, 2 * kTests> y_px;
};

TestPoints MakeTestPoints() {
  TestPoints points;
  const std::array<BriefTest, kTests>& tests = BriefTests();
  for (size_t i = 0; i < kTests; ++i) {
    points.x_px[i] = tests[i].first_x_px;
    points.y_px[i] = tests[i].first_y_px;
    points.x_px[kTests + i] = tests[i].second_x_px;
    points.y_px[kTests + i] = tests[i].second_y_px;
  }
  return points;
}

// Nearest integer for |x| < 2^22 without a function call, so that the compiler can vectorize loops. The sum has no bits
// left for a fraction.
inline float Round(float x) {
  constexpr float kNoFraction = 12582912.0F;  // 1.5 * 2^23
  return (x + kNoFraction) - kNoFraction;
}

}  // namespace

PatchDirection IntensityCentroid(const cv::Mat& image, int x_px, int y_px) {
  static const std::array<int, kPatchRadius_px + 1> half_width_px = CircleRows();
  const auto step = static_cast<std::ptrdiff_t>(image.step);
  const uint8_t* center = image.ptr<uint8_t>(y_px) + x_px;
  int moment_x = 0;
  int moment_y = 0;
  for (int x = -kPatchRadius_px; x <= kPatchRadius_px; ++x) moment_x += x * center[x];
  for (int y = 1; y <= kPatchRadius_px; ++y) {
    const uint8_t* below = center + y * step;
    const uint8_t* above = center - y * step;
    const int half_width = half_width_px[static_cast<size_t>(y)];
    int difference = 0;
    for (int x = -half_width; x <= half_width; ++x) {
      moment_x += x * (below[x] + above[x]);
      difference += below[x] - above[x];
    }
    moment_y += y * difference;
  }
  const auto length = static_cast<float>(std::hypot(moment_x, moment_y));
  if (length == 0) return {};
  return {static_cast<float>(moment_x) / length, static_cast<float>(moment_y) / length};
}

Descriptor SteeredBrief(const cv::Mat& smooth, int x_px, int y_px, const PatchDirection& direction) {
  static const TestPoints points = MakeTestPoints();
  const auto step = static_cast<float>(smooth.step);
  std::array<int, 2 * kTests> offsets;
  for (size_t i = 0; i < offsets.size(); ++i) {
    const float x = direction.cosine * points.x_px[i] - direction.sine * points.y_px[i];
    const float y = direction.sine * points.x_px[i] + direction.cosine * points.y_px[i];
    offsets[i] = static_cast<int>(Round(y) * step + Round(x));
  }
  const uint8_t* center = smooth.ptr<uint8_t>(y_px) + x_px;
  Descriptor descriptor{};
  for (size_t i = 0; i < kTests; ++i) {
    const bool bit = center[offsets[i]] < center[offsets[kTests + i]];
    descriptor[i / 64] |= static_cast<uint64_t>(bit) << (i % 64);
  }
  return descriptor;
}

}  // namespace romap::slam
