#include "server/objects/mask_extents.h"

#include <gtest/gtest.h>

#include <numbers>

namespace romap::objects::mask_extents_test {

constexpr double kBorder_px = 0.5;  // from the center of a mask's last pixel to its border

Detection LabelThree(const cv::Rect& box_px) {
  return {.label = 3, .class_name = "", .track_id = {}, .box_px = box_px};
}

TEST(MaskExtentsTest, DirectionsAreUnitVectorsInOppositePairs) {
  EXPECT_NEAR((ExtentDirection(0) - Eigen::Vector2d(1, 0)).norm(), 0, 1e-12);
  EXPECT_NEAR((ExtentDirection(kExtentDirections / 4) - Eigen::Vector2d(0, 1)).norm(), 0, 1e-12);
  for (int k = 0; k < kExtentDirections / 2; ++k) {
    EXPECT_NEAR(ExtentDirection(k).norm(), 1, 1e-12);
    EXPECT_NEAR((ExtentDirection(k) + ExtentDirection(k + kExtentDirections / 2)).norm(), 0, 1e-12);
  }
}

TEST(MaskExtentsTest, EqualTheSupportFunctionOfARectangle) {
  cv::Mat labels = cv::Mat::zeros(100, 120, CV_16UC1);
  const cv::Rect rectangle(20, 30, 41, 21);  // columns 20..60, rows 30..50
  labels(rectangle).setTo(3);
  const MaskExtents extents = MeasureExtents(labels, LabelThree(rectangle));
  for (int k = 0; k < kExtentDirections; ++k) {
    const Eigen::Vector2d n = ExtentDirection(k);
    const Eigen::Vector2d corner(n.x() > 0 ? 60 : 20, n.y() > 0 ? 50 : 30);
    EXPECT_NEAR(extents.reach_px[static_cast<size_t>(k)], n.dot(corner) + kBorder_px, 0.15) << k;
    const Eigen::Vector2f tip = extents.tip_px[static_cast<size_t>(k)];
    EXPECT_EQ(labels.at<uint16_t>(static_cast<int>(tip.y()), static_cast<int>(tip.x())), 3) << k;
  }
}

// Another mask in the same box must not count, neither in the same rows nor in other rows.
TEST(MaskExtentsTest, IgnoreOtherLabels) {
  cv::Mat labels = cv::Mat::zeros(100, 120, CV_16UC1);
  labels(cv::Rect(20, 30, 30, 10)).setTo(3);
  labels(cv::Rect(20, 40, 1, 10)).setTo(3);
  const cv::Rect tight(20, 30, 30, 20);
  const MaskExtents alone = MeasureExtents(labels, LabelThree(tight));
  labels(cv::Rect(30, 40, 20, 10)).setTo(7);
  const MaskExtents beside = MeasureExtents(labels, LabelThree(tight));
  EXPECT_EQ(alone.reach_px, beside.reach_px);
  EXPECT_LT(alone.reach_px[2], std::numbers::sqrt2 / 2 * (49 + 49));  // the corner filled by the other mask
}

}  // namespace romap::objects::mask_extents_test
