#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "server/objects/detections.h"

namespace romap::objects {

// Extents are measured in kExtentDirections directions of the image (u right, v down). Direction k has the angle 2 pi k
// / kExtentDirections, so the indices of opposite directions differ by kExtentDirections / 2.
inline constexpr int kExtentDirections = 16;
Eigen::Vector2d ExtentDirection(int k);

// The support function of a mask, and the pixels where it is attained.
struct MaskExtents {
  // Largest n_k . (u, v) over the mask, for each direction n_k.
  std::array<float, kExtentDirections> reach_px{};
  // The outermost pixel in each direction, (u, v).
  std::array<Eigen::Vector2f, kExtentDirections> tip_px;
};

// `labels` (CV_16UC1) contains `detection`. About half a pixel is added, because the border of a mask is between its
// last pixels and the next ones.
MaskExtents MeasureExtents(const cv::Mat& labels, const Detection& detection);

}  // namespace romap::objects
