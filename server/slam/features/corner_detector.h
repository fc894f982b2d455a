#pragma once

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <vector>

namespace romap::slam {

using Corners = std::vector<cv::KeyPoint>;  // pt: whole pixels; response: FAST score in gray levels

// FAST-9 corners (Rosten and Drummond, ECCV 2006) of the part of a CV_8UC1 image, with coordinates of the whole image,
// row by row. Only the strongest of adjacent ones counts.
Corners DetectCorners(const cv::Mat& image, const cv::Rect& part, int threshold);

// The same, but cells that have no corner at `threshold` are searched again at `min_threshold`: in a dim or blurred
// part of the image, weak corners are better than none.
Corners DetectCornersEverywhere(const cv::Mat& image, const cv::Rect& part, int threshold, int min_threshold);

// `count` of the corners, or all if there are not as many, evenly spread: strong corners that keep a distance from each
// other, which is made as large as the count allows (suppression by square covering, Bailo et al., Pattern Recognition
// Letters 2018). Strongest first.
Corners SpreadEvenly(Corners corners, const cv::Size& image_size, size_t count);

}  // namespace romap::slam
