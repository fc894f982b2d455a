#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core/mat.hpp>

namespace romap {

// The label under a pixel of a label image (CV_16UC1), if all pixels within `erosion_px` have it too: masks err at
// their rims. Else 0, as outside the image and without an image.
uint16_t LabelAt(const cv::Mat& labels, const Eigen::Vector2f& pixel_px, int erosion_px);

}  // namespace romap
