#include "server/slam/depth_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace romap::slam::depth_check_test {

using ::testing::HasSubstr;

CameraModel Vga() {
  return {.width_px = 640, .height_px = 480, .fx_px = 560, .fy_px = 560, .cx_px = 319.5, .cy_px = 239.5};
}

// Pairs of a camera that moves sideways. `factor`: of the depth image over the true depth. `along_ray`: the image holds
// distances from the camera's center instead.
DepthCheck Feed(double factor, double baseline_mu, double depth_noise, int pairs, bool along_ray = false) {
  DepthCheck check;
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> u(20, 620), v(20, 460), depth(1, 4);
  std::normal_distribution<double> noise(0, 1);
  for (int k = 0; k < pairs; ++k) {
    PoseCheck::AgreeingPair pair{.first_frame_id = static_cast<uint64_t>(k + 1)};
    pair.T_second_first = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(baseline_mu, 0.02, 0)};
    cv::Mat depth_mu(480, 640, CV_32FC1, cv::Scalar(0));
    for (int i = 0; i < 120; ++i) {
      const double z_mu = depth(random);
      const Eigen::Vector3d p_first = z_mu * Vga().Unproject(u(random), v(random));
      const Eigen::Vector3d p_second = pair.T_second_first * p_first;
      const Eigen::Vector2d second_px = Vga().Project(p_second) + 0.5 * Eigen::Vector2d(noise(random), noise(random));
      pair.matches.push_back({Vga().Project(p_first), second_px, 0.8});
      const auto column = static_cast<int>(std::lround(second_px.x()));
      const auto row = static_cast<int>(std::lround(second_px.y()));
      if (column < 0 || column > 639 || row < 0 || row > 479) continue;
      depth_mu.at<float>(row, column) =
          static_cast<float>(factor * (along_ray ? p_second.norm() : p_second.z()) * (1 + depth_noise * noise(random)));
    }
    check.AddPair(Vga(), pair, depth_mu);
  }
  return check;
}

TEST(DepthCheck, SoundDepthAgrees) {
  EXPECT_FALSE(Feed(1, 0.3, 0.03, 10).IsContradicted());
  EXPECT_FALSE(Feed(1.08, 0.3, 0.05, 10).IsContradicted());
}

TEST(DepthCheck, NamesTheFactor) {
  const DepthCheck check = Feed(0.2, 0.3, 0.03, 4);
  ASSERT_TRUE(check.Check().has_value());
  EXPECT_EQ(check.Check()->code, "depth_contradicts_images");
  EXPECT_THAT(check.Check()->text, HasSubstr("5.0"));
  EXPECT_THAT(check.Check()->text, HasSubstr("times too small"));
  EXPECT_THAT(check.Check()->advice, HasSubstr("multiply the depth scale"));
  EXPECT_THAT(Feed(1.3, 0.3, 0.03, 4).Check()->text, HasSubstr("times too large"));
}

TEST(DepthCheck, NamesDistancesAlongTheRays) {
  for (const double depth_noise : {0.0, 0.03}) {
    const auto diagnostic = Feed(1, 0.3, depth_noise, 12, /*along_ray=*/true).Check();
    ASSERT_TRUE(diagnostic.has_value()) << depth_noise;
    EXPECT_EQ(diagnostic->code, "depth_contradicts_images");
    EXPECT_THAT(diagnostic->text, HasSubstr("along the viewing rays"));
    EXPECT_THAT(diagnostic->advice, HasSubstr("divide the depth at pixel (u, v)"));
  }
  EXPECT_FALSE(Feed(1, 0.3, 0.15, 12).IsContradicted());
  EXPECT_FALSE(Feed(1, 0.3, 0, 12).IsContradicted());
  EXPECT_FALSE(Feed(1, 0.3, 0.03, 5, /*along_ray=*/true).IsContradicted());
}

TEST(DepthCheck, ACameraThatHardlyMovesGivesNoDecision) { EXPECT_FALSE(Feed(0.2, 0.01, 0.03, 10).IsContradicted()); }

TEST(DepthCheck, TwoPairsAreTooFew) { EXPECT_FALSE(Feed(0.2, 0.3, 0.03, 2).IsContradicted()); }

TEST(DepthCheck, RemovesTheDepthImageAlone) {
  Frame frame;
  frame.frame_id = 3;
  frame.image_bgr = cv::Mat(2, 2, CV_8UC3);
  frame.depth_mu = cv::Mat(2, 2, CV_32FC1);
  const auto without = WithoutDepth(frame);
  EXPECT_TRUE(without->depth_mu.empty());
  EXPECT_FALSE(frame.depth_mu.empty());
  EXPECT_EQ(without->image_bgr.data, frame.image_bgr.data);
}

}  // namespace romap::slam::depth_check_test
