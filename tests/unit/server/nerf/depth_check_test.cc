#include "server/nerf/depth_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::depth_check_test {

using testing_support::BallScene;

std::vector<ObjectView> ViewsWithDepth(double scale) {
  BallScene scene;
  scene.with_depth = true;
  std::vector<ObjectView> views = scene.Views();
  for (ObjectView& view : views) view.depth_mu = view.depth_mu * scale;
  return views;
}

TEST(DepthCheckTest, OnlyDepthOfTheRightScaleIsConsistent) {
  EXPECT_TRUE(DepthIsConsistent(ViewsWithDepth(1)));
  for (const double scale : {0.5, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.5, 3.0, 1000.0}) {
    EXPECT_FALSE(DepthIsConsistent(ViewsWithDepth(scale))) << scale;
  }
}

TEST(DepthCheckTest, ToleratesHolesAndOutliers) {
  std::vector<ObjectView> views = ViewsWithDepth(1);
  cv::RNG random(3);
  for (ObjectView& view : views) {
    for (auto z = view.depth_mu.begin<float>(); z != view.depth_mu.end<float>(); ++z) {
      const double draw = random.uniform(0.0, 1.0);
      if (draw < 0.3) *z = draw < 0.1 ? NAN : 0.0f;
      if (draw > 0.9) *z *= random.uniform(0.2f, 3.0f);
    }
  }
  EXPECT_TRUE(DepthIsConsistent(views));
}

TEST(DepthCheckTest, RandomDepthIsNotConsistent) {
  std::vector<ObjectView> views = ViewsWithDepth(1);
  cv::RNG random(3);
  for (ObjectView& view : views) random.fill(view.depth_mu, cv::RNG::UNIFORM, 0.2, 8);
  EXPECT_FALSE(DepthIsConsistent(views));
}

TEST(DepthCheckTest, ViewsWithoutDepthAreConsistent) {
  EXPECT_TRUE(DepthIsConsistent(BallScene().Views()));
  EXPECT_TRUE(DepthIsConsistent({}));
  std::vector<ObjectView> views = BallScene().Views();
  for (ObjectView& view : views) view.depth_mu = cv::Mat(view.roi_px.size(), CV_32FC1, cv::Scalar(NAN));
  EXPECT_TRUE(DepthIsConsistent(views));
}

}  // namespace romap::nerf::depth_check_test
