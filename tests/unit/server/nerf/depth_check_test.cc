#include "server/nerf/depth_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf {
namespace {

using testing::BallScene;

std::vector<ObjectView> ViewsWithDepth(double scale) {
  testing::BallScene scene;
  scene.with_depth = true;
  std::vector<ObjectView> views = scene.Views();
  for (ObjectView& view : views) view.depth_mu = view.depth_mu * scale;
  return views;
}

TEST(DepthCheckTest, TrueDepthFitsAndOtherScalesDoNot) {
  EXPECT_LT(MisplacedShare(ViewsWithDepth(1), 1), 0.02);
  EXPECT_TRUE(DepthsFit(ViewsWithDepth(1)));
  for (const double scale : {0.5, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.5, 3.0, 1000.0}) {
    EXPECT_FALSE(DepthsFit(ViewsWithDepth(scale))) << scale;
    EXPECT_NEAR(MisplacedShare(ViewsWithDepth(scale), 1 / scale), MisplacedShare(ViewsWithDepth(1), 1), 0.02);
  }
}

TEST(DepthCheckTest, HolesAndOutliersAreNoMisfit) {
  std::vector<ObjectView> views = ViewsWithDepth(1);
  cv::RNG random(3);
  for (ObjectView& view : views) {
    for (auto z = view.depth_mu.begin<float>(); z != view.depth_mu.end<float>(); ++z) {
      const double dice = random.uniform(0.0, 1.0);
      if (dice < 0.3) *z = dice < 0.1 ? NAN : 0.0f;
      if (dice > 0.9) *z *= random.uniform(0.2f, 3.0f);
    }
  }
  EXPECT_TRUE(DepthsFit(views));
}

TEST(DepthCheckTest, DepthOfAnythingDoesNotFit) {
  std::vector<ObjectView> views = ViewsWithDepth(1);
  cv::RNG random(3);
  for (ObjectView& view : views) random.fill(view.depth_mu, cv::RNG::UNIFORM, 0.2, 8);
  EXPECT_FALSE(DepthsFit(views));
}

TEST(DepthCheckTest, NoDepthIsNoMisfit) {
  EXPECT_TRUE(DepthsFit(testing::BallScene().Views()));
  EXPECT_TRUE(DepthsFit({}));
  EXPECT_EQ(MisplacedShare(testing::BallScene().Views(), 1), 0);
  std::vector<ObjectView> views = testing::BallScene().Views();
  for (ObjectView& view : views) view.depth_mu = cv::Mat(view.roi_px.size(), CV_32FC1, cv::Scalar(NAN));
  EXPECT_TRUE(DepthsFit(views));
}

}  // namespace
}  // namespace romap::nerf
