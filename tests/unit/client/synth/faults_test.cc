#include "client/synth/faults.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

namespace romap::synth::faults_test {

// Four squares of 40 px with labels 1..4 in an image of 200 x 200 px.
cv::Mat FourSquares() {
  cv::Mat labels = cv::Mat::zeros(200, 200, CV_8UC1);
  for (int i = 0; i < 4; ++i) {
    labels(cv::Rect(30 + 100 * (i % 2), 30 + 100 * (i / 2), 40, 40)).setTo(i + 1);
  }
  return labels;
}

TEST(DegradeMaskTest, ChangesNothingByDefault) {
  Random random(1);
  const FaultyMask mask = DegradeMask(FourSquares(), 4, {}, random);
  EXPECT_EQ(cv::countNonZero(mask.labels != FourSquares()), 0);
  ASSERT_EQ(mask.detections.size(), 4U);
  for (const SynthDetection& detection : mask.detections) {
    EXPECT_EQ(detection.label, detection.object);
    EXPECT_GT(detection.score, 0);
    EXPECT_LE(detection.score, 1);
  }
}

TEST(DegradeMaskTest, ListsOnlyVisibleLabels) {
  cv::Mat labels = FourSquares();
  labels.setTo(0, labels == 2);
  Random random(1);
  const FaultyMask mask = DegradeMask(labels, 4, {}, random);
  ASSERT_EQ(mask.detections.size(), 3U);
  EXPECT_EQ(mask.detections[1].object, 3);
}

TEST(DegradeMaskTest, DropsTheGivenShare) {
  Random random(2);
  size_t kept = 0;
  for (int i = 0; i < 250; ++i) {
    const FaultyMask mask = DegradeMask(FourSquares(), 4, {.mask_drop_share = 0.3}, random);
    kept += mask.detections.size();
    ASSERT_EQ(cv::countNonZero(mask.labels), 1600 * static_cast<int>(mask.detections.size()));
  }
  EXPECT_NEAR(static_cast<double>(kept) / 1000, 0.7, 0.05);
}

TEST(DegradeMaskTest, PermutesLabelsConsistentlyWithTheDetections) {
  Random random(3);
  const cv::Mat truth = FourSquares();
  std::set<uint8_t> labels_of_first;
  for (int i = 0; i < 50; ++i) {
    const FaultyMask mask = DegradeMask(truth, 4, {.permute_labels = true}, random);
    std::set<uint8_t> labels;
    for (const SynthDetection& detection : mask.detections) {
      labels.insert(detection.label);
      ASSERT_EQ(cv::countNonZero((mask.labels == detection.label) != (truth == detection.object)), 0);
      if (detection.object == 1) labels_of_first.insert(detection.label);
    }
    ASSERT_EQ(labels, (std::set<uint8_t>{1, 2, 3, 4}));
  }
  EXPECT_EQ(labels_of_first.size(), 4U);
}

TEST(DegradeMaskTest, DisplacesBordersByAboutTheJitter) {
  Random random(4);
  const cv::Mat truth = FourSquares();
  const FaultyMask mask = DegradeMask(truth, 4, {.mask_jitter_px = 4}, random);
  const cv::Mat changed = mask.labels != truth;
  EXPECT_GT(cv::countNonZero(changed), 100);
  // Nothing changes beyond the maximal displacement.
  cv::Mat far_inside;
  cv::erode(truth == 1, far_inside, cv::getStructuringElement(cv::MORPH_RECT, {15, 15}));
  EXPECT_GT(cv::countNonZero(far_inside), 400);
  EXPECT_EQ(cv::countNonZero(changed & far_inside), 0);
}

TEST(DegradeImageTest, ChangesNothingByDefault) {
  Random random(1);
  cv::Mat image(20, 20, CV_8UC3, cv::Scalar(50, 100, 150));
  DegradeImage(image, {1, 0}, {}, random);
  EXPECT_EQ(cv::norm(image, cv::Mat(20, 20, CV_8UC3, cv::Scalar(50, 100, 150))), 0);
}

TEST(DegradeImageTest, AddsNoiseOfTheGivenSigma) {
  Random random(1);
  cv::Mat image(100, 100, CV_8UC3, cv::Scalar(120, 120, 120));
  DegradeImage(image, {1, 0}, {.noise_sigma = 8}, random);
  cv::Scalar mean, deviation;
  cv::meanStdDev(image, mean, deviation);
  EXPECT_NEAR(mean[1], 120, 0.5);
  EXPECT_NEAR(deviation[1], 8, 0.3);
}

TEST(DegradeImageTest, BlursOnlyAlongTheMotion) {
  // A white dot becomes a line with the length of the blur.
  for (const cv::Vec2d& motion : {cv::Vec2d(3, 0), cv::Vec2d(0, -2)}) {
    Random random(1);
    cv::Mat image = cv::Mat::zeros(41, 41, CV_8UC3);
    image.at<cv::Vec3b>(20, 20) = {255, 255, 255};
    DegradeImage(image, motion, {.motion_blur_px = 10}, random);
    cv::Mat gray;
    cv::extractChannel(image, gray, 0);
    const cv::Rect line = cv::boundingRect(gray);
    const bool horizontal = motion[0] != 0;
    EXPECT_NEAR(horizontal ? line.width : line.height, 11, 1);
    EXPECT_EQ(horizontal ? line.height : line.width, 1);
    EXPECT_NEAR(cv::sum(gray)[0], 255, 15) << "the total intensity is preserved";
  }
}

TEST(DegradeImageTest, AppliesGainAndGamma) {
  Random random(1);
  cv::Mat image(4, 4, CV_8UC3, cv::Scalar(0, 64, 200));
  DegradeImage(image, {1, 0}, {}, random, {.gain = 2});
  EXPECT_EQ(image.at<cv::Vec3b>(0, 0), cv::Vec3b(0, 128, 255)) << "bright values clip";
  cv::Mat darker(4, 4, CV_8UC3, cv::Scalar(0, 64, 255));
  DegradeImage(darker, {1, 0}, {}, random, {.gamma = 2});
  EXPECT_EQ(darker.at<cv::Vec3b>(0, 0), cv::Vec3b(0, 16, 255)) << "gamma keeps black and white";
}

TEST(DegradeImageTest, BlackFrameIsBlack) {
  Random random(1);
  cv::Mat image(20, 20, CV_8UC3, cv::Scalar(50, 100, 150));
  DegradeImage(image, {1, 0}, {}, random, {.black = true});
  EXPECT_EQ(cv::norm(image), 0);
}

TEST(DegradeImageTest, BlurredFrameHasNoCorners) {
  // A checkerboard with squares of 8 px becomes almost uniform gray along the motion.
  Random random(1);
  cv::Mat image(120, 320, CV_8UC3);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      image.at<cv::Vec3b>(v, u) = cv::Vec3b::all((u / 8 + v / 8) % 2 == 0 ? 40 : 220);
    }
  }
  DegradeImage(image, {5, 0}, {}, random, {.blurred = true});
  cv::Scalar mean, deviation;
  cv::meanStdDev(image(cv::Rect(40, 20, 240, 80)), mean, deviation);
  EXPECT_LT(deviation[0], 30) << "90 without blur";
}

TEST(DegradeImageTest, DefocusSpreadsADot) {
  Random random(1);
  cv::Mat image = cv::Mat::zeros(41, 41, CV_8UC3);
  cv::circle(image, {20, 20}, 3, {255, 255, 255}, cv::FILLED);
  const int before = cv::countNonZero(image.reshape(1) > 20);
  DegradeImage(image, {0, 0}, {.defocus_px = 2}, random);
  EXPECT_GT(cv::countNonZero(image.reshape(1) > 20), 3 * before / 2);
}

TEST(DegradeDepthTest, NoiseGrowsWithTheSquareOfTheDepth) {
  for (const double z_m : {0.5, 1.0, 3.0}) {
    Random random(1);
    cv::Mat depth_m(100, 100, CV_32FC1, cv::Scalar(z_m));
    depth_m.row(0).setTo(0);
    DegradeDepth(depth_m, {.depth_noise_mm = 2}, random);
    EXPECT_EQ(cv::countNonZero(depth_m.row(0)), 0) << "pixels without depth";
    cv::Scalar mean, deviation;
    cv::meanStdDev(depth_m.rowRange(1, 100), mean, deviation);
    EXPECT_NEAR(mean[0], z_m, 1e-3);
    EXPECT_NEAR(deviation[0], 0.002 * z_m * z_m, 1e-4 * z_m * z_m);
  }
}

TEST(DegradeDepthTest, ChangesNothingByDefault) {
  Random random(1);
  cv::Mat depth_m(10, 10, CV_32FC1, cv::Scalar(1.5));
  DegradeDepth(depth_m, {}, random);
  EXPECT_EQ(cv::countNonZero(depth_m != 1.5), 0);
}

}  // namespace romap::synth::faults_test
