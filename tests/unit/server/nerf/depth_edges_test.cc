#include "server/nerf/depth_edges.h"

#include <gtest/gtest.h>

#include <limits>

namespace romap::nerf::depth_edges_test {

// A surface at 1 mu on the left of a background at 2 mu, and `border` in the column between them.
cv::Mat Step(float border_mu) {
  cv::Mat depth_mu(5, 7, CV_32FC1, cv::Scalar(2));
  depth_mu.colRange(0, 3).setTo(1);
  depth_mu.col(3).setTo(border_mu);
  return depth_mu;
}

TEST(DepthEdgesTest, AValueBetweenTwoSurfacesIsMixed) {
  EXPECT_TRUE(IsMixedDepth(Step(1.4F), {3, 2}));
  const cv::Mat transposed = Step(1.4F).t();
  EXPECT_TRUE(IsMixedDepth(transposed, {2, 3}));
}

TEST(DepthEdgesTest, TheBorderOfASurfaceIsNotMixed) {
  for (const int x : {2, 3, 4}) EXPECT_FALSE(IsMixedDepth(Step(1), {x, 2})) << x;
  for (const int x : {2, 3, 4}) EXPECT_FALSE(IsMixedDepth(Step(2), {x, 2})) << x;
}

TEST(DepthEdgesTest, AThinPartIsNotMixed) {
  cv::Mat depth_mu(5, 5, CV_32FC1, cv::Scalar(2));
  depth_mu.col(2).setTo(1);
  EXPECT_FALSE(IsMixedDepth(depth_mu, {2, 2}));
}

TEST(DepthEdgesTest, AnInclinedPlaneIsNotMixed) {
  cv::Mat depth_mu(5, 5, CV_32FC1);
  for (int x = 0; x < 5; ++x) depth_mu.col(x).setTo(1 + 0.02 * x);
  EXPECT_FALSE(IsMixedDepth(depth_mu, {2, 2}));
}

TEST(DepthEdgesTest, UnknownValuesAreNoEvidence) {
  cv::Mat depth_mu = Step(1.4F);
  depth_mu.colRange(4, 7).setTo(0);
  EXPECT_FALSE(IsMixedDepth(depth_mu, {3, 2}));
  depth_mu.colRange(4, 7).setTo(std::numeric_limits<float>::quiet_NaN());
  EXPECT_FALSE(IsMixedDepth(depth_mu, {3, 2}));
  EXPECT_FALSE(IsMixedDepth(depth_mu, {5, 2}));
  EXPECT_FALSE(IsMixedDepth(depth_mu, {0, 0}));
}

}  // namespace romap::nerf::depth_edges_test
