#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>

#include "server/slam/features/feature.h"

namespace romap::slam {

// A gray image at the sizes of all octaves: sharp for corner detection, smoothed for descriptors. Reuses its buffers.
class ImagePyramid {
 public:
  // `gray`: CV_8UC1; must not be modified afterward. Octaves with a side shorter than `min_side_px` are omitted.
  void Build(const cv::Mat& gray, int min_side_px);

  int octaves() const { return octaves_; }
  const cv::Mat& sharp(int octave) const { return sharp_[static_cast<size_t>(octave)]; }
  // Gaussian blur, computed once per image and octave, because binary tests of single pixels would mostly measure
  // noise.
  const cv::Mat& smooth(int octave);
  // Converts a pixel of an octave to a pixel of the full image. Pixel centers are at integer coordinates in both.
  Eigen::Vector2f ToFullSize(int octave, const cv::Point2f& pixel_px) const;
  // The smallest part of the octave's image that contains all of `part_px` of the full image.
  cv::Rect Part(int octave, const cv::Rect& part_px) const;

 private:
  int octaves_ = 0;
  std::array<cv::Mat, kOctaves> sharp_;
  std::array<cv::Mat, kOctaves> smooth_;
  std::array<bool, kOctaves> is_smoothed_{};
};

}  // namespace romap::slam
