#pragma once

#include <Eigen/Core>
#include <array>
#include <opencv2/core/mat.hpp>

#include "server/slam/features/feature.h"

namespace romap::slam {

// A gray image at the sizes of all octaves, sharp for finding corners and smoothed for describing them. Keeps its
// buffers from image to image.
class ImagePyramid {
 public:
  // Takes a CV_8UC1 image, which must not change afterwards. Octaves whose shorter side would be under `min_side_px`
  // are left out.
  void Build(const cv::Mat& gray, int min_side_px);

  int octaves() const { return octaves_; }
  const cv::Mat& sharp(int octave) const { return sharp_[static_cast<size_t>(octave)]; }
  // Blurred by a Gaussian, once for each image and octave: binary tests of single pixels would mostly see noise.
  const cv::Mat& smooth(int octave);
  // The pixel of the full image at a pixel of an octave, both with pixel centers at integer coordinates.
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
