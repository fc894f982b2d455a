#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "server/objects/detections.h"

namespace romap::objects {

// Direction k of an extent has the angle 2 pi k / kExtentDirections in the image, u right and v down, so that opposite
// directions are half the count apart.
inline constexpr int kExtentDirections = 16;
Eigen::Vector2d ExtentDirection(int k);

// How far a mask reaches (its support function) and what ends it there.
struct MaskExtents {
  // Largest n_k . (u, v) over the mask, for each direction n_k.
  std::array<float, kExtentDirections> reach_px{};
  // The outermost pixel itself, (u, v).
  std::array<Eigen::Vector2f, kExtentDirections> tip_px;
};

// `labels` (CV_16UC1) holds `detection`, whose box is tight. Half a pixel's width is added, for a mask's border runs
// between its last pixels and the next ones.
MaskExtents MeasureExtents(const cv::Mat& labels, const Detection& detection);

}  // namespace romap::objects
