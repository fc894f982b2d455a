#include "common/label_image.h"

#include <gtest/gtest.h>

namespace romap::label_image_test {

TEST(LabelAt, IsZeroNearAnotherLabelAndOutside) {
  cv::Mat labels = cv::Mat::zeros(20, 30, CV_16UC1);
  labels(cv::Rect(10, 5, 10, 10)) = 300;
  EXPECT_EQ(LabelAt(labels, {15, 10}, 2), 300);
  EXPECT_EQ(LabelAt(labels, {12, 10}, 2), 300);
  EXPECT_EQ(LabelAt(labels, {11, 10}, 2), 0) << "one pixel from the border of the mask";
  EXPECT_EQ(LabelAt(labels, {11, 10}, 0), 300);
  EXPECT_EQ(LabelAt(labels, {9.6F, 5.4F}, 0), 300) << "coordinates are rounded to the nearest pixel";
  EXPECT_EQ(LabelAt(labels, {-1, 3}, 0), 0);
  EXPECT_EQ(LabelAt(labels, {29.6F, 3}, 0), 0);
  EXPECT_EQ(LabelAt({}, {5, 5}, 2), 0);
}

TEST(LabelAt, ImageBorderDoesNotErodeTheMask) {
  const cv::Mat labels(20, 30, CV_16UC1, cv::Scalar(7));
  EXPECT_EQ(LabelAt(labels, {0, 0}, 3), 7);
}

}  // namespace romap::label_image_test
