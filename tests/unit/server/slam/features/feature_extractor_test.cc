#include "server/slam/features/feature_extractor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/unit/server/slam/textured_world.h"

namespace romap {
namespace {

size_t CountLabelled(const std::vector<Feature>& features) {
  return static_cast<size_t>(
      std::count_if(features.begin(), features.end(), [](const Feature& f) { return f.label != 0; }));
}

TEST(FeatureExtractor, SpreadsFeaturesOverTheImage) {
  const TexturedWorld world;
  const auto frame = world.Render(1, TexturedWorld::LookAt({0, 0, 2}, {0, 0, 0}));
  const std::vector<Feature> features = FeatureExtractor(SlamConfig{}).Extract(*frame);
  std::array<int, 4> of_quarter{};
  for (const Feature& feature : features) {
    ++of_quarter[(feature.pixel_px.x() > 160 ? 1 : 0) + (feature.pixel_px.y() > 120 ? 2 : 0)];
  }
  EXPECT_THAT(of_quarter, ::testing::Each(::testing::Gt(50)));
}

TEST(FeatureExtractor, AWeaklyTexturedObjectStillGetsFeatures) {
  const TexturedWorld world;
  const auto frame = world.Render(1, TexturedWorld::OrbitPose(0), 0);
  cv::Mat faint;
  frame->image_bgr.convertTo(faint, -1, 0.12, 100);  // contrast below the scene's threshold
  faint.copyTo(frame->image_bgr, frame->labels > 0);
  SlamConfig config;
  const size_t with_share = CountLabelled(FeatureExtractor(config).Extract(*frame));
  config.object_features = 0;
  const size_t without_share = CountLabelled(FeatureExtractor(config).Extract(*frame));
  EXPECT_GT(with_share, 20);
  EXPECT_GT(with_share, 3 * without_share);
}

TEST(FeatureExtractor, AFeatureOnTheMasksBorderHasNoLabel) {
  const TexturedWorld world;
  const auto frame = world.Render(1, TexturedWorld::OrbitPose(0));
  SlamConfig config;
  config.mask_erosion_px = 3;
  const std::vector<Feature> features = FeatureExtractor(config).Extract(*frame);
  cv::Mat inner;
  cv::erode(frame->labels, inner, cv::Mat::ones(7, 7, CV_8UC1));
  EXPECT_GT(CountLabelled(features), 20);
  for (const Feature& feature : features) {
    const int u = static_cast<int>(std::lround(feature.pixel_px.x()));
    const int v = static_cast<int>(std::lround(feature.pixel_px.y()));
    EXPECT_EQ(feature.label, inner.at<uint16_t>(v, u)) << u << " " << v;
  }
}

TEST(FeatureExtractor, TheSameFrameGivesTheSameFeatures) {
  const TexturedWorld world;
  const auto frame = world.Render(1, TexturedWorld::OrbitPose(0));
  FeatureExtractor extractor{SlamConfig{}};
  const std::vector<Feature> once = extractor.Extract(*frame);
  const std::vector<Feature> again = extractor.Extract(*frame);
  ASSERT_EQ(once.size(), again.size());
  for (size_t i = 0; i < once.size(); ++i) {
    EXPECT_EQ(once[i].pixel_px, again[i].pixel_px);
    EXPECT_EQ(once[i].descriptor, again[i].descriptor);
  }
}

TEST(FeatureExtractor, ABlackOrTinyImageHasNone) {
  const TexturedWorld world;
  auto frame = world.Render(1, TexturedWorld::OrbitPose(0));
  frame->image_bgr.setTo(0);
  EXPECT_TRUE(FeatureExtractor(SlamConfig{}).Extract(*frame).empty());

  const TexturedWorld tiny(16, 16);
  EXPECT_TRUE(FeatureExtractor(SlamConfig{}).Extract(*tiny.Render(1, TexturedWorld::OrbitPose(0))).empty());
  const TexturedWorld small(48, 48);  // just large enough to look at, too small for the upper octaves
  FeatureExtractor(SlamConfig{}).Extract(*small.Render(1, TexturedWorld::OrbitPose(0)));
}

}  // namespace
}  // namespace romap
