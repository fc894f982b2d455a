#include "server/slam/fixed_features.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "tests/unit/server/slam/random_descriptor.h"

namespace romap::slam::fixed_features_test {

// A scene that moves through the image from frame to frame, and a region fixed to the camera.
class FixedFeaturesTest : public ::testing::Test {
 protected:
  static constexpr int kScene = 1500;  // in an area of 4 images, about a quarter is visible
  static constexpr int kFixed = 300;

  FixedFeaturesTest() {
    for (int i = 0; i < kScene; ++i) scene_.push_back(Random(-640, 1280, -480, 960));
    for (int i = 0; i < kFixed; ++i) fixed_.push_back(Random(20, 280, 250, 470));
  }

  Feature Random(float left_px, float right_px, float top_px, float bottom_px) {
    std::uniform_real_distribution<float> x_px(left_px, right_px);
    std::uniform_real_distribution<float> y_px(top_px, bottom_px);
    return {.pixel_px = {x_px(random_), y_px(random_)}, .descriptor = RandomDescriptor(random_)};
  }

  // The share of scene features and of fixed ones that are found to be fixed.
  struct Shares {
    double scene = 0;
    double fixed = 0;
  };
  Shares Process(float shift_px, bool with_fixed) {
    std::normal_distribution<float> noise_px(0, 0.3F);
    std::vector<Feature> features;
    for (Feature feature : scene_) {
      feature.pixel_px.x() += shift_px;
      const bool is_covered = with_fixed && feature.pixel_px.x() < 280 && feature.pixel_px.y() > 250;
      const bool is_inside = feature.pixel_px.x() > 5 && feature.pixel_px.x() < 635 && feature.pixel_px.y() > 5 &&
                             feature.pixel_px.y() < 475;
      if (is_inside && !is_covered) features.push_back(feature);
    }
    const size_t of_scene = features.size();
    if (with_fixed) features.insert(features.end(), fixed_.begin(), fixed_.end());
    for (Feature& feature : features) feature.pixel_px += Eigen::Vector2f(noise_px(random_), noise_px(random_));
    const std::vector<uint8_t> found = finder_.Find(camera_, features);
    const auto middle = found.begin() + static_cast<std::ptrdiff_t>(of_scene);
    return {static_cast<double>(std::count(found.begin(), middle, 1)) / static_cast<double>(of_scene),
            with_fixed ? static_cast<double>(std::count(middle, found.end(), 1)) / kFixed : 0};
  }

  const CameraModel camera_{
      .width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500, .cx_px = 319.5, .cy_px = 239.5};
  std::mt19937_64 random_{3};
  std::vector<Feature> scene_;
  std::vector<Feature> fixed_;
  FixedFeatures finder_;
};

TEST_F(FixedFeaturesTest, FindsWhatStaysWhileTheSceneMoves) {
  Shares shares;
  for (int i = 0; i < 30; ++i) {
    shares = Process(6.0F * static_cast<float>(i), /*with_fixed=*/true);
    EXPECT_LT(shares.scene, 0.01) << "frame " << i;
  }
  EXPECT_GT(shares.fixed, 0.9);
}

TEST_F(FixedFeaturesTest, DecidesNothingBeforeTheSceneMovedSeveralTimes) {
  for (int i = 0; i < 7; ++i) EXPECT_EQ(Process(6.0F * static_cast<float>(i), /*with_fixed=*/true).fixed, 0);
}

TEST_F(FixedFeaturesTest, AStaticCameraHasNoFixedFeatures) {
  for (int i = 0; i < 30; ++i) EXPECT_EQ(Process(0, /*with_fixed=*/true).scene, 0);
}

TEST_F(FixedFeaturesTest, AnEndOfTheMotionFixesNothing) {
  for (int i = 0; i < 20; ++i) Process(6.0F * static_cast<float>(i), /*with_fixed=*/true);
  for (int i = 0; i < 20; ++i) {
    const Shares shares = Process(120, /*with_fixed=*/true);
    EXPECT_LT(shares.scene, 0.01);
    EXPECT_GT(shares.fixed, 0.9);
  }
}

TEST_F(FixedFeaturesTest, ASlowSceneIsNotFixed) {
  for (int i = 0; i < 200; ++i) EXPECT_LT(Process(0.4F * static_cast<float>(i), /*with_fixed=*/true).scene, 0.01) << i;
}

}  // namespace romap::slam::fixed_features_test
