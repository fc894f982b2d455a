#include "server/slam/features/image_pyramid.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace romap::slam {
namespace {

// About the smoothing of the ORB paper, whose tests compare the means of patches of 5 x 5 pixels.
constexpr int kSmoothingSide_px = 7;
constexpr double kSmoothingSigma_px = 2;

}  // namespace

void ImagePyramid::Build(const cv::Mat& gray, int min_side_px) {
  octaves_ = 0;
  is_smoothed_.fill(false);
  for (size_t i = 0; i < kOctaves; ++i) {
    const double scale = std::pow(kOctaveFactor, i);
    const cv::Size size(static_cast<int>(std::lround(gray.cols / scale)),
                        static_cast<int>(std::lround(gray.rows / scale)));
    if (std::min(size.width, size.height) < min_side_px) return;
    if (i == 0) {
      sharp_[i] = gray;
    } else {
      cv::resize(sharp_[i - 1], sharp_[i], size, 0, 0, cv::INTER_LINEAR);
    }
    ++octaves_;
  }
}

const cv::Mat& ImagePyramid::smooth(int octave) {
  const auto i = static_cast<size_t>(octave);
  if (!is_smoothed_[i]) {
    cv::GaussianBlur(sharp_[i], smooth_[i], {kSmoothingSide_px, kSmoothingSide_px}, kSmoothingSigma_px);
    is_smoothed_[i] = true;
  }
  return smooth_[i];
}

// cv::resize aligns the outer edges of both images, not the centers of their first pixels. Sizes are rounded to whole
// pixels, so their ratio differs slightly from kOctaveFactor.
Eigen::Vector2f ImagePyramid::ToFullSize(int octave, const cv::Point2f& pixel_px) const {
  const cv::Mat& full = sharp_[0];
  const cv::Mat& level = sharp(octave);
  return {(pixel_px.x + 0.5F) * static_cast<float>(full.cols) / static_cast<float>(level.cols) - 0.5F,
          (pixel_px.y + 0.5F) * static_cast<float>(full.rows) / static_cast<float>(level.rows) - 0.5F};
}

cv::Rect ImagePyramid::Part(int octave, const cv::Rect& part_px) const {
  const cv::Mat& full = sharp_[0];
  const cv::Mat& level = sharp(octave);
  const cv::Point begin(part_px.x * level.cols / full.cols, part_px.y * level.rows / full.rows);
  const cv::Point end((part_px.br().x * level.cols + full.cols - 1) / full.cols,
                      (part_px.br().y * level.rows + full.rows - 1) / full.rows);
  return {begin, end};
}

}  // namespace romap::slam
