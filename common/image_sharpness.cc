#include "common/image_sharpness.h"

#include <opencv2/imgproc.hpp>

namespace romap {

double ImageSharpness(const cv::Mat& image_bgr) {
  cv::Mat gray, laplacian;
  cv::cvtColor(image_bgr, gray, cv::COLOR_BGR2GRAY);
  cv::Laplacian(gray, laplacian, CV_16S);
  cv::Scalar mean, deviation;
  cv::meanStdDev(laplacian, mean, deviation);
  return deviation[0] * deviation[0];
}

}  // namespace romap
