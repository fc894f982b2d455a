#include "common/image_sharpness.h"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace romap::image_sharpness_test {

cv::Mat Checkerboard(int cell_px) {
  cv::Mat image(64, 64, CV_8UC3);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      image.at<cv::Vec3b>(v, u) = cv::Vec3b::all((u / cell_px + v / cell_px) % 2 == 0 ? 50 : 200);
    }
  }
  return image;
}

TEST(ImageSharpness, IsZeroForAUniformImage) {
  EXPECT_EQ(ImageSharpness(cv::Mat(20, 30, CV_8UC3, cv::Scalar(10, 20, 30))), 0);
}

TEST(ImageSharpness, DecreasesWithBlur) {
  const cv::Mat sharp = Checkerboard(8);
  double previous = ImageSharpness(sharp);
  for (const int width_px : {3, 7, 15}) {
    cv::Mat blurred;
    cv::blur(sharp, blurred, {width_px, 1});
    const double sharpness = ImageSharpness(blurred);
    EXPECT_LT(sharpness, 0.9 * previous) << width_px;
    previous = sharpness;
  }
}

TEST(ImageSharpness, UsesOnlyThePixelsOfASubimage) {
  const cv::Mat image = Checkerboard(8);
  const cv::Rect part(3, 5, 20, 24);
  EXPECT_EQ(ImageSharpness(image(part)), ImageSharpness(image(part).clone()));
}

}  // namespace romap::image_sharpness_test
