#include "server/nerf/mask_border.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "server/nerf/model/occupancy.h"
#include "server/nerf/object_field.h"
#include "server/nerf/visual_hull.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::mask_border_test {

using testing_support::BallScene;

// Views of a ball whose mask borders are displaced by up to about `amplitude_px`, smoothly along the border and
// differently in each view.
std::vector<ObjectView> WavyViews(const BallScene& scene, float amplitude_px) {
  std::vector<ObjectView> views = scene.Views();
  for (size_t k = 0; k < views.size(); ++k) {
    const cv::Size size = views[k].ray_kind.size();
    cv::Mat x(size, CV_32FC1), y(size, CV_32FC1);
    const float phase = 1.7f * static_cast<float>(k);
    for (int v = 0; v < size.height; ++v) {
      for (int u = 0; u < size.width; ++u) {
        const auto u_px = static_cast<float>(u), v_px = static_cast<float>(v);
        x.at<float>(v, u) = u_px + amplitude_px * std::sin(0.25f * v_px + phase);
        y.at<float>(v, u) = v_px + amplitude_px * std::sin(0.25f * u_px + 2 * phase);
      }
    }
    cv::Mat moved;
    cv::remap(views[k].ray_kind, moved, x, y, cv::INTER_NEAREST, cv::BORDER_REPLICATE);
    views[k].ray_kind = moved;
  }
  return views;
}

// The noise of the masks of `views` relative to an opaque ball, the hull of the exact masks.
MaskNoise NoiseAgainstTheBall(const BallScene& scene, const std::vector<ObjectView>& views,
                              const std::vector<float>& weights) {
  NerfConfig config;
  config.density_bias = 8;  // opaque without training
  const TrainingBox box = TrainingBox::Around(scene.Box(), 0.1);
  VisualHull hull(config);
  hull.Reset(box);
  for (const ObjectView& view : scene.Views()) hull.Add(view);
  Occupancy occupancy(config);
  occupancy.SetHull(hull.Carve());
  RaySet rays(config, 1);
  rays.Build(views, box);
  return MeasureMaskNoise(views, weights, rays, FieldModel(config, 1), config, {occupancy.bits(), {1, 1, 1}, {}});
}

TEST(MaskBorderTest, MeasuresTheNoiseOfMasks) {
  const BallScene scene{.size_px = 120};
  const std::vector<float> all(static_cast<size_t>(scene.views), 1.0f);
  const MaskNoise exact = NoiseAgainstTheBall(scene, scene.Views(), all);
  EXPECT_GT(exact.points, 100);
  EXPECT_LT(exact.spread_px, 0.9);
  EXPECT_EQ(UncertainBorder_px(exact, 2), 0);
  // Half of the values of a sine are beyond 0.71 of its amplitude, so its quartiles are those of a normal distribution
  // whose standard deviation is 1.05 of the amplitude.
  for (const float amplitude_px : {2.0f, 4.0f}) {
    const MaskNoise noise = NoiseAgainstTheBall(scene, WavyViews(scene, amplitude_px), all);
    EXPECT_NEAR(noise.spread_px, 1.05 * amplitude_px, 0.15 * amplitude_px);
    EXPECT_NEAR(UncertainBorder_px(noise, 2), 2 * noise.spread_px, 0.51);
  }
}

TEST(MaskBorderTest, UntrustedViewsAreNoEvidence) {
  const BallScene scene{.size_px = 120};
  std::vector<ObjectView> views = WavyViews(scene, 4);
  const std::vector<ObjectView> exact = scene.Views();
  std::vector<float> weights(views.size(), 0.0f);
  for (size_t i = 0; i < views.size(); i += 2) {
    views[i] = exact[i];
    weights[i] = 1;
  }
  EXPECT_LT(NoiseAgainstTheBall(scene, views, weights).spread_px, 0.9);
}

TEST(MaskBorderTest, WithoutASilhouetteTheNoiseIsUnknown) {
  const BallScene scene{.size_px = 120};
  std::vector<ObjectView> views = scene.Views();
  for (ObjectView& view : views) view.ray_kind.setTo(static_cast<int>(RayKind::kObject));
  const MaskNoise noise = NoiseAgainstTheBall(scene, views, std::vector<float>(views.size(), 1.0f));
  EXPECT_EQ(noise.points, 0);
  EXPECT_EQ(UncertainBorder_px(noise, 2), 0);
  EXPECT_EQ(UncertainBorder_px({.points = 10, .spread_px = 3}, 2), 0) << "too few points";
}

TEST(MaskBorderTest, PossibleObjectIncludesTheUncertainBorder) {
  ObjectView view;
  view.ray_kind = cv::Mat(20, 20, CV_8UC1, cv::Scalar(static_cast<int>(RayKind::kBackground)));
  view.ray_kind.at<uint8_t>(10, 10) = static_cast<uint8_t>(RayKind::kObject);
  EXPECT_EQ(cv::countNonZero(PossibleObject(view, 0)), 1);
  const cv::Mat possible = PossibleObject(view, 3);
  EXPECT_EQ(possible.at<uint8_t>(10, 13), 255);
  EXPECT_EQ(possible.at<uint8_t>(10, 14), 0);
  EXPECT_EQ(possible.at<uint8_t>(13, 13), 0) << "a disk";
}

// The share of the cells inside a ball of 0.95 of the radius that the hull has lost.
double LostShare(const FieldSnapshot& snapshot) {
  const int side = snapshot.hull.resolution;
  double inside = 0, lost = 0;
  for (size_t cell = 0; cell < snapshot.hull.bits.size(); ++cell) {
    const auto coordinate = [&](size_t at) { return 1.1 * ((static_cast<double>(at) + 0.5) * 2 / side - 1); };
    const auto n = static_cast<size_t>(side);
    const Eigen::Vector3d p(coordinate(cell % n), coordinate(cell / n % n), coordinate(cell / n / n));
    if (p.norm() > 0.95) continue;
    ++inside;
    lost += snapshot.hull.bits[cell] == 0 ? 1 : 0;
  }
  return lost / inside;
}

// The ball has a radius of about 12 px.
double LostShareAfterTraining(double mask_border_spreads) {
  const BallScene scene{.views = 30, .size_px = 36};
  NerfConfig config;
  config.mask_border_spreads = mask_border_spreads;
  ObjectField field(config, scene.object, 1);
  EXPECT_TRUE(field.SetBox(scene.Box()).ok());
  for (const ObjectView& view : WavyViews(scene, 4)) EXPECT_TRUE(field.AddView(view).ok());
  field.Train(150, 1);
  return LostShare(field.Snapshot());
}

TEST(MaskBorderTest, ImpreciseMasksDoNotErodeTheHull) {
  EXPECT_GT(LostShareAfterTraining(0), 0.3);
  EXPECT_LT(LostShareAfterTraining(2), 0.1);
}

}  // namespace romap::nerf::mask_border_test
