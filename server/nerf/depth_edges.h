#pragma once

#include <opencv2/core.hpp>

namespace romap::nerf {

// Whether a depth value mixes two surfaces, as sensors report at the border of a near one: it lies between the values
// on opposite sides of the pixel and differs clearly from both. Thin parts in front of a far background do not: both
// sides are farther. `depth_mu`: CV_32FC1, not positive or not finite = unknown; such neighbors are no evidence.
bool IsMixedDepth(const cv::Mat& depth_mu, cv::Point at);

}  // namespace romap::nerf
