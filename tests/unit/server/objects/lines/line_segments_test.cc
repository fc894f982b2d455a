#include "server/objects/lines/line_segments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace romap::objects::line_segments_test {

using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr uint16_t kLabel = 7;

// A bright rotated square on a dark background, and its mask.
struct TestImage {
  cv::Mat image_bgr = cv::Mat(480, 640, CV_8UC3, cv::Scalar(50, 60, 40));
  cv::Mat labels = cv::Mat::zeros(480, 640, CV_16UC1);
  std::vector<Eigen::Vector2d> corners_px;
  cv::Rect box_px;
};

TestImage DrawSquare(const Eigen::Vector2d& center_px, double half_side_px, double turn_rad) {
  TestImage image;
  std::vector<cv::Point> polygon;
  constexpr int kSubpixelBits = 8;
  for (int i = 0; i < 4; ++i) {
    const double angle = turn_rad + (i + 0.5) * std::numbers::pi / 2;
    const Eigen::Vector2d corner =
        center_px + half_side_px * std::numbers::sqrt2 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    image.corners_px.push_back(corner);
    polygon.emplace_back(static_cast<int>(std::lround(corner.x() * (1 << kSubpixelBits))),
                         static_cast<int>(std::lround(corner.y() * (1 << kSubpixelBits))));
  }
  cv::fillConvexPoly(image.image_bgr, polygon, cv::Scalar(200, 210, 190), cv::LINE_AA, kSubpixelBits);
  cv::fillConvexPoly(image.labels, polygon, cv::Scalar(kLabel), cv::LINE_8, kSubpixelBits);
  cv::GaussianBlur(image.image_bgr, image.image_bgr, {3, 3}, 0.7);
  cv::Mat points;
  cv::findNonZero(image.labels == kLabel, points);
  image.box_px = cv::boundingRect(points);
  return image;
}

std::vector<LineSegment> Find(const TestImage& image, const LineSegmentOptions& options = {}) {
  return FindLineSegments(image.image_bgr, image.labels, kLabel, image.box_px, options);
}

// Distance of a point from the infinite line through two others.
double DistanceFromLine(const Eigen::Vector2d& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d along = (b - a).normalized();
  return std::abs(along.x() * (p - a).y() - along.y() * (p - a).x());
}

// Number of segments on the side between corners `i` and `i + 1`, ends within `limit_px` of it.
int CountOnSide(const TestImage& image, const std::vector<LineSegment>& segments, size_t i, double limit_px) {
  const Eigen::Vector2d& a = image.corners_px[i];
  const Eigen::Vector2d& b = image.corners_px[(i + 1) % 4];
  int count = 0;
  for (const LineSegment& segment : segments) {
    const bool on_side = DistanceFromLine(segment.from_px, a, b) < limit_px &&
                         DistanceFromLine(segment.to_px, a, b) < limit_px && segment.Length_px() > 0.7 * (b - a).norm();
    count += on_side ? 1 : 0;
  }
  return count;
}

class RotatedSquareTest : public ::testing::TestWithParam<double> {};

TEST_P(RotatedSquareTest, FindsEachSideOnce) {
  const TestImage image = DrawSquare({322.3, 231.8}, 40, GetParam());
  const std::vector<LineSegment> segments = Find(image);
  EXPECT_THAT(segments, SizeIs(4));
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(CountOnSide(image, segments, i, 1.5), 1) << "side " << i;
}

TEST_P(RotatedSquareTest, FindsTheSidesOfALargeObjectInADownscaledImage) {
  const TestImage image = DrawSquare({322.3, 231.8}, 140, GetParam());
  const std::vector<LineSegment> segments = Find(image);
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(CountOnSide(image, segments, i, 2.5), 1) << "side " << i;
}

INSTANTIATE_TEST_SUITE_P(Turns, RotatedSquareTest, ::testing::Values(0.0, 0.15, 0.4, 0.75, 1.2));

TEST(LineSegmentsTest, IgnoresSegmentsBesideTheMask) {
  TestImage image = DrawSquare({320, 240}, 40, 0.3);
  const std::vector<LineSegment> before = Find(image);
  // Inside the crop, but outside of the dilated mask.
  cv::line(image.image_bgr, {270, 285}, {300, 295}, cv::Scalar(255, 255, 255), 2);
  EXPECT_THAT(Find(image), SizeIs(before.size()));
  LineSegmentOptions wide;
  wide.dilation_px = 40;
  EXPECT_GT(Find(image, wide).size(), before.size());
}

TEST(LineSegmentsTest, ReturnsTheLongestFirstUpToTheMaximum) {
  TestImage image = DrawSquare({320, 240}, 60, 0);
  for (int i = 0; i < 5; ++i) {
    cv::line(image.image_bgr, {280, 200 + 16 * i}, {310 + 8 * i, 200 + 16 * i}, cv::Scalar(0, 0, 0), 3);
  }
  const std::vector<LineSegment> all = Find(image);
  ASSERT_GT(all.size(), 6u);
  for (size_t i = 1; i < all.size(); ++i) EXPECT_GE(all[i - 1].Length_px(), all[i].Length_px());
  LineSegmentOptions few;
  few.max_segments = 3;
  const std::vector<LineSegment> longest = Find(image, few);
  ASSERT_THAT(longest, SizeIs(3));
  for (size_t i = 0; i < 3; ++i) EXPECT_EQ(longest[i].from_px, all[i].from_px);
}

TEST(LineSegmentsTest, WorksAtTheBorderOfTheImage) {
  const TestImage image = DrawSquare({10, 470}, 40, 0.2);
  const std::vector<LineSegment> segments = Find(image);
  EXPECT_GE(segments.size(), 2u);
  for (const LineSegment& segment : segments) {
    for (const Eigen::Vector2d& p : {segment.from_px, segment.to_px}) {
      EXPECT_TRUE(p.x() >= 0 && p.y() >= 0 && p.x() < 640 && p.y() < 480) << p.transpose();
    }
  }
}

TEST(LineSegmentsTest, FindsNothingOnUniformOrTinyMasks) {
  TestImage plain;
  cv::rectangle(plain.labels, {200, 200, 80, 60}, cv::Scalar(kLabel), cv::FILLED);
  plain.box_px = {200, 200, 80, 60};
  EXPECT_THAT(Find(plain), IsEmpty());
  for (const cv::Rect& box : {cv::Rect(0, 0, 1, 1), cv::Rect(639, 479, 1, 1), cv::Rect(300, 0, 2, 480)}) {
    TestImage tiny;
    tiny.labels(box).setTo(kLabel);
    tiny.box_px = box;
    EXPECT_THAT(Find(tiny), IsEmpty()) << box;
  }
}

TEST(LineSegmentsTest, DoesNotDependOnEarlierCalls) {
  const TestImage image = DrawSquare({320, 240}, 40, 0.3);
  const std::vector<LineSegment> first = Find(image);
  Find(DrawSquare({200, 200}, 90, 0.6));
  const std::vector<LineSegment> second = Find(image);
  ASSERT_EQ(first.size(), second.size());
  for (size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].from_px, second[i].from_px);
    EXPECT_EQ(first[i].to_px, second[i].to_px);
  }
}

}  // namespace romap::objects::line_segments_test
