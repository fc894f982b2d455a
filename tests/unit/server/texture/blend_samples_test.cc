#include "server/texture/blend_samples.h"

#include <gtest/gtest.h>

#include <vector>

namespace romap::texture::blend_samples_test {

ViewSample Gray(float weight, float color, float low) {
  return {weight, Eigen::Array3f::Constant(color), Eigen::Array3f::Constant(low)};
}

TEST(BlendSamplesTest, OneSampleIsTheColor) {
  EXPECT_TRUE(BlendSamples(std::vector{Gray(0.1f, 77, 20)}, 3).isApproxToConstant(77));
  EXPECT_TRUE(BlendSamples(std::vector{Gray(0.1f, 300, 20)}, 3).isApproxToConstant(255));
}

TEST(BlendSamplesTest, LowFrequenciesAreTheMeanAndDetailsThoseOfTheBest) {
  // The views differ by 6 levels in brightness; the detail is +10 in the best view and +4 in the others.
  std::vector<ViewSample> samples = {Gray(1, 113, 103)};
  for (int i = 0; i < 4; ++i) samples.push_back(Gray(0.4f, 101, 97));
  const float color = BlendSamples(samples, 6)[0];
  EXPECT_NEAR(color, 110, 2);  // the mean of the low frequencies is about 99.5
  const float with_all = BlendSamples(samples, 0)[0];
  EXPECT_NEAR(with_all, 104.5, 2);
}

TEST(BlendSamplesTest, TheMinorityIsRejectedEvenIfItHasTheLargestWeight) {
  for (const float wrong : {0.0f, 255.0f}) {
    std::vector<ViewSample> samples = {Gray(1.5f, wrong, wrong)};
    for (int i = 0; i < 5; ++i) samples.push_back(Gray(0.5f, 118.0f + static_cast<float>(i), 110));
    EXPECT_NEAR(BlendSamples(samples, 3)[0], 120, 4) << wrong;
  }
}

// The point itself looks right, but a highlight beside it changes the low frequencies of the best view.
TEST(BlendSamplesTest, AWrongNeighborhoodIsRejected) {
  std::vector<ViewSample> samples = {Gray(1, 120, 180)};
  for (int i = 0; i < 5; ++i) samples.push_back(Gray(0.5f, 120, 110));
  EXPECT_NEAR(BlendSamples(samples, 3)[0], 120, 5);
}

TEST(BlendSamplesTest, ChannelsAreIndependent) {
  std::vector<ViewSample> samples;
  for (int i = 0; i < kMostSamples; ++i) samples.push_back({1, {10, 120, 250}, {10, 120, 250}});
  EXPECT_TRUE(BlendSamples(samples, 3).isApprox(Eigen::Array3f(10, 120, 250)));
}

}  // namespace romap::texture::blend_samples_test
