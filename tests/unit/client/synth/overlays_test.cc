#include "client/synth/overlays.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "client/synth/synth_camera.h"

namespace romap::synth::overlays_test {

constexpr int kWidth_px = 160;
constexpr int kHeight_px = 120;

SynthOptions Options() { return {.seed = 4, .frames = 200, .fps = 25, .width_px = kWidth_px, .height_px = kHeight_px}; }

// One object that fills the image at a depth of 2 m.
TrueFrame EmptyFrame() {
  TrueFrame frame;
  frame.color_bgr = cv::Mat(kHeight_px, kWidth_px, CV_8UC3, cv::Scalar(1, 2, 3));
  frame.labels = cv::Mat(kHeight_px, kWidth_px, CV_8UC1, cv::Scalar(7));
  frame.depth_m = cv::Mat(kHeight_px, kWidth_px, CV_32FC1, cv::Scalar(2));
  return frame;
}

TrueFrame Drawn(const SynthOptions& options, int frame) {
  TrueFrame image = EmptyFrame();
  Overlays(options, SynthCamera(options)).Apply(frame, image);
  return image;
}

double CoveredShare(const TrueFrame& frame) {
  return static_cast<double>(cv::countNonZero(frame.labels == 0)) / (kWidth_px * kHeight_px);
}

TEST(OverlaysTest, DrawNothingByDefault) {
  const TrueFrame frame = Drawn(Options(), 10);
  EXPECT_EQ(CoveredShare(frame), 0);
  EXPECT_EQ(cv::norm(frame.color_bgr, EmptyFrame().color_bgr), 0);
}

TEST(OverlaysTest, GripperCoversTheGivenShareAndDoesNotMove) {
  for (const double share : {0.05, 0.2, 0.6}) {
    SynthOptions options = Options();
    options.gripper_share = share;
    const TrueFrame first = Drawn(options, 0);
    EXPECT_NEAR(CoveredShare(first), share, 0.02);
    EXPECT_EQ(cv::norm(first.color_bgr, Drawn(options, 150).color_bgr), 0);
    EXPECT_EQ(cv::countNonZero((first.depth_m < 1) != (first.labels == 0)), 0) << "nearer than the scene";
    cv::Scalar mean, deviation;
    cv::meanStdDev(first.color_bgr, mean, deviation, first.labels == 0);
    EXPECT_GT(deviation[1], 3) << "textured";
  }
}

TEST(OverlaysTest, OccluderMovesAcrossTheImage) {
  SynthOptions options = Options();
  options.occluder_share = 0.15;
  double largest = 0;
  cv::Mat hidden_in_some_frame = cv::Mat::zeros(kHeight_px, kWidth_px, CV_8UC1);
  for (int i = 0; i < options.frames; i += 4) {
    const TrueFrame frame = Drawn(options, i);
    largest = std::max(largest, CoveredShare(frame));
    hidden_in_some_frame |= frame.labels == 0;
  }
  EXPECT_NEAR(largest, 0.15, 0.05);
  EXPECT_GT(cv::countNonZero(hidden_in_some_frame), 0.4 * kWidth_px * kHeight_px);
  EXPECT_LT(CoveredShare(Drawn(options, 0)), 0.01) << "enters from outside the image";
  EXPECT_GT(CoveredShare(Drawn(options, 50)), 0.1) << "crosses in four seconds";
}

TEST(OverlaysTest, SeedsDiffer) {
  SynthOptions options = Options();
  options.occluder_share = 0.15;
  options.gripper_share = 0.15;
  const TrueFrame first = Drawn(options, 50);
  options.seed = 5;
  EXPECT_GT(cv::norm(first.color_bgr, Drawn(options, 50).color_bgr), 1000);
}

}  // namespace romap::synth::overlays_test
