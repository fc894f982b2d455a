#include "server/objects/mask_extents.h"

#include <cmath>
#include <numbers>

namespace romap::objects {

Eigen::Vector2d ExtentDirection(int k) {
  const double angle = 2 * std::numbers::pi * k / kExtentDirections;
  return {std::cos(angle), std::sin(angle)};
}

MaskExtents MeasureExtents(const cv::Mat& labels, const Detection& detection) {
  constexpr float kHalfPixel = 0.4F;  // less than 0.5: the maximum over many pixels is biased outward
  std::array<Eigen::Vector2f, kExtentDirections> directions;
  for (int k = 0; k < kExtentDirections; ++k) {
    directions[static_cast<size_t>(k)] = ExtentDirection(k).cast<float>();
  }
  MaskExtents extents;
  extents.reach_px.fill(-1e9F);
  const cv::Rect& box = detection.box_px;
  for (int v = box.y; v < box.y + box.height; ++v) {
    const auto* row = labels.ptr<uint16_t>(v);
    int first = box.x;
    int last = box.x + box.width - 1;
    while (first <= last && row[first] != detection.label) ++first;
    if (first > last) continue;
    while (row[last] != detection.label) --last;
    // The outermost pixel in any direction is one of the two ends of its row.
    for (const int u : {first, last}) {
      const Eigen::Vector2f pixel(static_cast<float>(u), static_cast<float>(v));
      for (size_t k = 0; k < kExtentDirections; ++k) {
        const float reach = directions[k].dot(pixel);
        if (reach <= extents.reach_px[k]) continue;
        extents.reach_px[k] = reach;
        extents.tip_px[k] = pixel;
      }
    }
  }
  for (float& reach : extents.reach_px) reach += kHalfPixel;
  return extents;
}

}  // namespace romap::objects
