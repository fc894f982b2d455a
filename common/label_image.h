#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace romap {

// The label of pixels about which the masks say nothing: there may be an object or not, e.g. behind a robot's gripper.
inline constexpr uint16_t kIgnoreLabel = 65535;

// The label at a pixel of a label image (CV_16UC1), if all pixels within `erosion_px` have the same label, because
// masks are inaccurate near their borders. Otherwise 0; also 0 for kIgnoreLabel, outside the
// image, or if the image is empty.
uint16_t LabelAt(const cv::Mat& labels, const Eigen::Vector2f& pixel_px, int erosion_px);

}  // namespace romap
