#include "server/session/depth_sentinels.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

namespace romap::session::depth_sentinels_test {

constexpr double kScale_mu = 0.001;

// A slope with depths from 1 to 1.5 map units and an area with a given value in the corner.
cv::Mat SlopeWith(double value_mu) {
  cv::Mat depth_mu(60, 80, CV_32FC1);
  for (int v = 0; v < depth_mu.rows; ++v) {
    for (int u = 0; u < depth_mu.cols; ++u) {
      const bool in_corner = u < 20 && v < 20;
      depth_mu.at<float>(v, u) = static_cast<float>(in_corner ? value_mu : kScale_mu * (1000 + (7 * u + 3 * v) % 500));
    }
  }
  return depth_mu;
}

TEST(DepthSentinelsTest, RemovesTheLargestValueOf16Bits) {
  DepthSentinels sentinels;
  cv::Mat depth_mu = SlopeWith(65.535);
  sentinels.Remove(7, kScale_mu, &depth_mu);
  EXPECT_EQ(depth_mu.at<float>(5, 5), 0);
  EXPECT_GT(depth_mu.at<float>(50, 50), 0.9);
  ASSERT_TRUE(sentinels.diagnostic().has_value());
  EXPECT_EQ(sentinels.diagnostic()->first_frame_id, 7u);
}

TEST(DepthSentinelsTest, RemovesTheEndOfTheSensorsRange) {
  for (const double value_mu : {10.0, 4.095, 0.1}) {
    DepthSentinels sentinels;
    cv::Mat depth_mu = SlopeWith(value_mu);
    sentinels.Remove(1, kScale_mu, &depth_mu);
    EXPECT_EQ(depth_mu.at<float>(5, 5), 0) << value_mu;
    EXPECT_GT(depth_mu.at<float>(50, 50), 0.9);
  }
}

TEST(DepthSentinelsTest, KeepsASurfaceParallelToTheImage) {
  DepthSentinels sentinels;
  cv::Mat depth_mu = SlopeWith(2.0);
  // Noise of the sensor: one unit.
  for (int v = 0; v < 20; ++v) {
    for (int u = 0; u < 20; ++u) depth_mu.at<float>(v, u) += static_cast<float>(kScale_mu * ((u + v) % 3 - 1));
  }
  sentinels.Remove(1, kScale_mu, &depth_mu);
  EXPECT_GT(depth_mu.at<float>(5, 5), 1.9);
  EXPECT_FALSE(sentinels.diagnostic().has_value());
}

TEST(DepthSentinelsTest, KeepsAnImageWithOneValueAlone) {
  DepthSentinels sentinels;
  cv::Mat depth_mu(60, 80, CV_32FC1, cv::Scalar(1.5));
  sentinels.Remove(1, kScale_mu, &depth_mu);
  EXPECT_FLOAT_EQ(depth_mu.at<float>(5, 5), 1.5F);
}

TEST(DepthSentinelsTest, NamesImagesWithoutDepth) {
  DepthSentinels sentinels;
  for (uint64_t frame = 1; frame <= 12; ++frame) {
    cv::Mat depth_mu = frame > 4 && frame <= 9 ? cv::Mat(60, 80, CV_32FC1, cv::Scalar(0)) : SlopeWith(1.2);
    sentinels.Remove(frame, kScale_mu, &depth_mu);
    EXPECT_EQ(sentinels.CheckEmpty().has_value(), frame >= 9);
  }
  EXPECT_EQ(sentinels.CheckEmpty()->code, "depth_empty");
  EXPECT_EQ(sentinels.CheckEmpty()->first_frame_id, 5u);
  EXPECT_EQ(sentinels.CheckEmpty()->count, 5u);
}

TEST(DepthSentinelsTest, CountsFrames) {
  DepthSentinels sentinels;
  for (uint64_t frame = 3; frame < 6; ++frame) {
    cv::Mat depth_mu = SlopeWith(65.535);
    sentinels.Remove(frame, kScale_mu, &depth_mu);
  }
  EXPECT_EQ(sentinels.diagnostic()->count, 3u);
  EXPECT_EQ(sentinels.diagnostic()->first_frame_id, 3u);
}

}  // namespace romap::session::depth_sentinels_test
