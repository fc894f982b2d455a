#include "common/label_image.h"

#include <cmath>

namespace romap {

uint16_t LabelAt(const cv::Mat& labels, const Eigen::Vector2f& pixel_px, int erosion_px) {
  if (labels.empty()) return 0;
  const int u = static_cast<int>(std::lround(pixel_px.x()));
  const int v = static_cast<int>(std::lround(pixel_px.y()));
  const cv::Rect image(0, 0, labels.cols, labels.rows);
  if (!image.contains({u, v})) return 0;
  const uint16_t label = labels.at<uint16_t>(v, u);
  const cv::Rect near = cv::Rect(u - erosion_px, v - erosion_px, 2 * erosion_px + 1, 2 * erosion_px + 1) & image;
  for (int y = near.y; y < near.br().y; ++y) {
    for (int x = near.x; x < near.br().x; ++x) {
      if (labels.at<uint16_t>(y, x) != label) return 0;
    }
  }
  return label == kIgnoreLabel ? 0 : label;
}

}  // namespace romap
