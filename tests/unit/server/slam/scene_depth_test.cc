#include "server/slam/scene_depth.h"

#include <gtest/gtest.h>

#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::scene_depth_test {

// Looks straight down from 3 mu above the floor, shifted along x.
SE3<World, Camera> PoseAbove(double x_mu) { return TexturedWorld::LookAt({x_mu, 0.9, 3}, {x_mu, 0.9, 0}); }

TEST(SceneDepth, MeasuresTheDistanceOfAPlane) {
  const TexturedWorld world;
  const DepthView first = MakeDepthView(*world.Render(1, PoseAbove(0)), PoseAbove(0));
  for (const double baseline_mu : {0.1, 0.25}) {
    const DepthView second = MakeDepthView(*world.Render(2, PoseAbove(baseline_mu)), PoseAbove(baseline_mu));
    const auto depth_mu = SceneDepth(first, second);
    ASSERT_TRUE(depth_mu) << baseline_mu;
    EXPECT_NEAR(*depth_mu, 3, 0.5) << baseline_mu;
  }
}

TEST(SceneDepth, ReturnsNothingWithoutBaselineOrTexture) {
  const TexturedWorld world;
  const DepthView first = MakeDepthView(*world.Render(1, PoseAbove(0)), PoseAbove(0));
  EXPECT_FALSE(SceneDepth(first, first));

  auto black = world.Render(2, PoseAbove(0.2));
  black->image_bgr = cv::Mat::zeros(black->image_bgr.size(), CV_8UC3);
  const DepthView second = MakeDepthView(*black, PoseAbove(0.2));
  EXPECT_FALSE(SceneDepth(second, second));
  EXPECT_FALSE(SceneDepth(MakeDepthView(*black, PoseAbove(0)), second));
}

TEST(SceneDepth, UsesTheDepthImageIfThereIsOne) {
  const TexturedWorld world;
  auto frame = world.Render(1, PoseAbove(0));
  frame->depth_mu = world.RenderDepth(*frame);
  const DepthView view = MakeDepthView(*frame, PoseAbove(0));
  ASSERT_TRUE(SceneDepth(view, view));
  EXPECT_NEAR(*SceneDepth(view, view), 3, 0.01);
}

TEST(MakeDepthView, BlurredFrameIsLessSharp) {
  const TexturedWorld world;
  auto frame = world.Render(1, PoseAbove(0));
  const double sharp = MakeDepthView(*frame, PoseAbove(0)).sharpness;
  cv::blur(frame->image_bgr, frame->image_bgr, {9, 1});
  EXPECT_LT(MakeDepthView(*frame, PoseAbove(0)).sharpness, 0.6 * sharp);
}

}  // namespace romap::slam::scene_depth_test
