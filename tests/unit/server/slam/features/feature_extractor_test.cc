#include "server/slam/features/feature_extractor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "common/lens.h"
#include "tests/unit/server/slam/textured_world.h"

namespace romap::slam::feature_extractor_test {

size_t CountLabeled(const std::vector<Feature>& features) {
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

TEST(FeatureExtractor, FindsFeaturesOnWeaklyTexturedObjects) {
  const TexturedWorld world;
  const auto frame = world.Render(1, TexturedWorld::OrbitPose(0), 0);
  cv::Mat faint;
  frame->image_bgr.convertTo(faint, -1, 0.12, 100);  // contrast below the scene's threshold
  faint.copyTo(frame->image_bgr, frame->labels > 0);
  SlamConfig config;
  const size_t with_object_features = CountLabeled(FeatureExtractor(config).Extract(*frame));
  config.object_features = 0;
  const size_t without_object_features = CountLabeled(FeatureExtractor(config).Extract(*frame));
  EXPECT_GT(with_object_features, 20);
  EXPECT_GT(with_object_features, 3 * without_object_features);
}

TEST(FeatureExtractor, FeaturesNearMaskBordersHaveNoLabel) {
  const TexturedWorld world;
  const auto frame = world.Render(1, TexturedWorld::OrbitPose(0));
  SlamConfig config;
  config.mask_erosion_px = 3;
  const std::vector<Feature> features = FeatureExtractor(config).Extract(*frame);
  EXPECT_GT(CountLabeled(features), 20);
  for (const Feature& feature : features) {
    const int radius_px = static_cast<int>(std::lround(3 * feature.octave_scale));
    cv::Mat inner;
    cv::erode(frame->labels, inner, cv::Mat::ones(2 * radius_px + 1, 2 * radius_px + 1, CV_8UC1));
    const int u = static_cast<int>(std::lround(feature.pixel_px.x()));
    const int v = static_cast<int>(std::lround(feature.pixel_px.y()));
    EXPECT_EQ(feature.label, inner.at<uint16_t>(v, u)) << u << " " << v;
  }
}

TEST(FeatureExtractor, ReturnsTheRequestedNumber) {
  const TexturedWorld world;
  const auto frame = world.Render(1, TexturedWorld::OrbitPose(0));
  SlamConfig config;
  config.scene_features = 50;
  config.object_features = 3;  // fewer than octaves
  FeatureExtractor extractor(config);
  const std::vector<Feature> scene = extractor.ExtractScene(*frame);
  EXPECT_EQ(scene.size(), 50U);
  EXPECT_EQ(extractor.ExtractObjects(*frame, scene).size(), 3U);
}

TEST(FeatureExtractor, IsDeterministic) {
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

TEST(FeatureExtractor, ReturnsNothingForBlackOrTinyImages) {
  const TexturedWorld world;
  auto frame = world.Render(1, TexturedWorld::OrbitPose(0));
  frame->image_bgr.setTo(0);
  EXPECT_TRUE(FeatureExtractor(SlamConfig{}).Extract(*frame).empty());

  const TexturedWorld tiny(16, 16);
  EXPECT_TRUE(FeatureExtractor(SlamConfig{}).Extract(*tiny.Render(1, TexturedWorld::OrbitPose(0))).empty());
}

TEST(FeatureExtractor, OmitsOctavesThatAreTooSmall) {
  const TexturedWorld small(48, 48);  // large enough for the two finest octaves only
  for (const Feature& feature : FeatureExtractor(SlamConfig{}).Extract(*small.Render(1, TexturedWorld::OrbitPose(0)))) {
    EXPECT_LE(feature.octave, 1);
  }
}

// The frame as captured by a camera with this lens.
Frame CaptureThroughLens(const CameraModel& source_camera, const Frame& pinhole) {
  Frame frame = pinhole;
  frame.source_camera = source_camera;
  std::vector<Eigen::Vector2f> pixels_px;
  for (int v = 0; v < source_camera.height_px; ++v) {
    for (int u = 0; u < source_camera.width_px; ++u) pixels_px.emplace_back(u, v);
  }
  const std::vector<Eigen::Vector2f> pinhole_px = UndistortPixels(source_camera, pixels_px);
  const cv::Mat map(source_camera.height_px, source_camera.width_px, CV_32FC2,
                    const_cast<Eigen::Vector2f*>(pinhole_px.data()));
  cv::Mat gray;
  cv::cvtColor(pinhole.image_bgr, gray, cv::COLOR_BGR2GRAY);
  cv::remap(gray, frame.source_gray, map, cv::noArray(), cv::INTER_CUBIC);
  return frame;
}

struct Agreement {
  int matches = 0;
  int near = 0;  // within a pixel of their octave of the expected position
};

// Compares the fine features, whose positions are accurate to a pixel. Counts those with a similar descriptor in
// `others`, and those of them that are also at the same position.
Agreement Compare(const std::vector<Feature>& features, const std::vector<Feature>& others) {
  Agreement agreement;
  for (const Feature& feature : features) {
    if (feature.octave > 1) continue;
    const auto nearest = std::min_element(others.begin(), others.end(), [&](const Feature& a, const Feature& b) {
      return HammingDistance(a.descriptor, feature.descriptor) < HammingDistance(b.descriptor, feature.descriptor);
    });
    if (nearest == others.end() || HammingDistance(nearest->descriptor, feature.descriptor) > 40) continue;
    ++agreement.matches;
    if ((nearest->pixel_px - feature.pixel_px).norm() < feature.octave_scale) ++agreement.near;
  }
  return agreement;
}

class FeatureExtractorLens : public testing::TestWithParam<LensModel> {};

TEST_P(FeatureExtractorLens, PositionsAgreeWithThePinholeImage) {
  const TexturedWorld world(640, 480);
  const auto pinhole = world.Render(1, TexturedWorld::OrbitPose(0), 0);
  CameraModel camera = world.camera();
  camera.lens = GetParam();
  camera.distortion = camera.lens == LensModel::kFisheye ? std::array<double, 5>{-0.02, 0.005, 0, 0, 0}
                                                         : std::array<double, 5>{-0.2, 0.04, 0.001, -0.001, 0};
  const Frame distorted = CaptureThroughLens(camera, *pinhole);
  FeatureExtractor extractor{SlamConfig{}};
  const std::vector<Feature> expected = extractor.ExtractScene(*pinhole);
  const std::vector<Feature> features = extractor.ExtractScene(distorted);
  const Agreement scene = Compare(features, expected);
  EXPECT_GT(scene.matches, 100);
  EXPECT_GT(scene.near, 0.9 * scene.matches);

  const std::vector<Feature> object_features = extractor.ExtractObjects(distorted, features);
  const Agreement objects = Compare(object_features, extractor.ExtractObjects(*pinhole, {}));
  EXPECT_GT(objects.matches, 20);
  EXPECT_GT(objects.near, 0.9 * objects.matches);
  for (const Feature& feature : object_features) {
    EXPECT_NE(distorted.labels.at<uint16_t>(static_cast<int>(std::lround(feature.pixel_px.y())),
                                            static_cast<int>(std::lround(feature.pixel_px.x()))),
              0);
  }
}

INSTANTIATE_TEST_SUITE_P(Lenses, FeatureExtractorLens,
                         testing::Values(LensModel::kRadialTangential, LensModel::kFisheye),
                         [](const auto& info) { return info.index == 0 ? "RadialTangential" : "Fisheye"; });

TEST(FeatureExtractor, DropsFeaturesOutsideThePinholeImage) {
  const TexturedWorld world;
  Frame frame = *world.Render(1, TexturedWorld::OrbitPose(0));
  cv::cvtColor(frame.image_bgr, frame.source_gray, cv::COLOR_BGR2GRAY);
  frame.source_camera = frame.camera;
  frame.source_camera.lens = LensModel::kFisheye;
  frame.source_camera.fx_px = frame.source_camera.fy_px = 100;  // much larger field of view
  frame.camera = frame.source_camera.Pinhole();
  const std::vector<Feature> features = FeatureExtractor(SlamConfig{}).ExtractScene(frame);
  EXPECT_GT(features.size(), 500);  // dropped features are replaced by others
  for (const Feature& feature : features) {
    EXPECT_TRUE(cv::Rect2f(0, 0, 319, 239).contains({feature.pixel_px.x(), feature.pixel_px.y()}));
  }
}

TEST(FeatureExtractor, ObjectFeaturesDoNotRepeatSceneFeatures) {
  const TexturedWorld world;
  const auto frame = world.Render(1, TexturedWorld::OrbitPose(0));
  FeatureExtractor extractor{SlamConfig{}};
  const std::vector<Feature> scene = extractor.ExtractScene(*frame);
  const std::vector<Feature> objects = extractor.ExtractObjects(*frame, scene);
  EXPECT_GT(objects.size(), 50);
  for (const Feature& feature : objects) {
    EXPECT_TRUE(std::none_of(scene.begin(), scene.end(), [&](const Feature& other) {
      return other.octave == feature.octave && (other.pixel_px - feature.pixel_px).norm() < feature.octave_scale;
    }));
  }
}

TEST(FeatureExtractor, AnglesAndPositionsRotateWithTheImage) {
  const TexturedWorld world(400, 400);
  Frame frame = *world.Render(1, TexturedWorld::LookAt({0, 0, 2}, {0, 0, 0}), 0);
  FeatureExtractor extractor{SlamConfig{}};
  const std::vector<Feature> upright = extractor.ExtractScene(frame);
  cv::Mat rotated_bgr;
  cv::rotate(frame.image_bgr, rotated_bgr, cv::ROTATE_90_CLOCKWISE);
  frame.image_bgr = rotated_bgr;
  std::vector<Feature> rotated = extractor.ExtractScene(frame);
  for (Feature& feature : rotated) {
    feature.pixel_px = {feature.pixel_px.y(), 399 - feature.pixel_px.x()};  // rotated back
  }
  int same = 0, rotated_equally = 0, similar_descriptors = 0;
  for (const Feature& feature : upright) {
    for (const Feature& other : rotated) {
      if (other.octave != feature.octave || (other.pixel_px - feature.pixel_px).norm() > 0.5) continue;
      ++same;
      const double rotation_rad = std::remainder(other.angle_rad - feature.angle_rad, 2 * std::numbers::pi);
      if (std::abs(rotation_rad - std::numbers::pi / 2) < 0.1) ++rotated_equally;
      if (HammingDistance(feature.descriptor, other.descriptor) < 30) ++similar_descriptors;
    }
  }
  EXPECT_GT(same, 300);
  EXPECT_GT(rotated_equally, 0.95 * same);
  EXPECT_GT(similar_descriptors, 0.95 * same);
}

}  // namespace romap::slam::feature_extractor_test
