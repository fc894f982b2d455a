#pragma once

#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <vector>

namespace romap::slam {

using Corners = std::vector<cv::KeyPoint>;  // pt: whole pixels; response: FAST score in gray levels

// Detects FAST-9 corners (Rosten and Drummond, ECCV 2006) in a part of a CV_8UC1 image. Coordinates are those of the
// whole image; the order is row by row. Only the strongest of adjacent corners is kept.
Corners DetectCorners(const cv::Mat& image, const cv::Rect& part, int threshold);

// The same, but also searches cells with few corners at `min_threshold`, because weak corners are better than none in a
// dim or blurred part of the image.
Corners DetectCornersEverywhere(const cv::Mat& image, const cv::Rect& part, int threshold, int min_threshold);

// Selects at most `count` corners, spread evenly over the image: takes strong corners first and keeps a minimum
// distance between corners, which is as large as `count` allows (suppression via square covering, Bailo et al., Pattern
// Recognition Letters 2018). Strongest first.
Corners SpreadEvenly(Corners corners, const cv::Size& image_size, size_t count);

}  // namespace romap::slam
