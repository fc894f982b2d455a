// ObjectField with a signed-distance field.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/nerf/object_field.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::object_field_distance_test {

using testing_support::BallScene;
using testing_support::BallSurfaceError;
using testing_support::RawOnGrid;

NerfConfig DistanceConfig() {
  NerfConfig config;
  config.field = "sdf";
  config.full_budget_steps = 200;
  return config;
}

ObjectField MakeField(const BallScene& scene, const NerfConfig& config) {
  ObjectField field(config, scene.object, 1);
  EXPECT_TRUE(field.SetBox(scene.Box()).ok());
  for (const ObjectView& view : scene.Views()) EXPECT_TRUE(field.AddView(view).ok());
  return field;
}

TEST(ObjectFieldDistanceTest, StartsFromTheHullAndLearnsTheBall) {
  const BallScene scene;
  ObjectField field = MakeField(scene, DistanceConfig());
  field.Train(1, 1);
  EXPECT_LT(BallSurfaceError(scene, field.Snapshot()), 0.15) << "initialized with the hull";
  const TrainStats stats = field.Train(199, 1);
  EXPECT_LT(stats.color_loss, 0.05);
  const FieldSnapshot snapshot = field.Snapshot();
  EXPECT_LT(BallSurfaceError(scene, snapshot), 0.04);
  EXPECT_EQ(snapshot.surface_level, 0);
}

TEST(ObjectFieldDistanceTest, RawValuesAreDistances) {
  const BallScene scene;
  ObjectField field = MakeField(scene, DistanceConfig());
  field.Train(200, 1);
  const FieldSnapshot snapshot = field.Snapshot();
  const float unit_mu = 2 * snapshot.box_half_extents.maxCoeff();
  for (const float offset : {-0.05f, -0.02f, 0.0f}) {  // radii; raw values outside the hull are not trained
    double sum = 0;
    int count = 0;
    for (int i = 0; i < 60; ++i) {
      const float azimuth = 0.1f * static_cast<float>(i), z = 0.5f * std::sin(0.37f * static_cast<float>(i));
      const Eigen::Vector3f direction(std::sqrt(1 - z * z) * std::cos(azimuth),
                                      std::sqrt(1 - z * z) * std::sin(azimuth), z);
      const std::vector<Eigen::Vector3f> point = {direction * static_cast<float>(scene.radius_mu) * (1 + offset)};
      std::vector<float> raw(1);
      snapshot.field->Sample(point, raw, {});
      sum += -raw[0] * kDistancePerRaw * unit_mu / scene.radius_mu;
      ++count;
    }
    EXPECT_NEAR(sum / count, offset, 0.025) << "mean distance in radii";
  }
}

TEST(ObjectFieldDistanceTest, IsDeterministic) {
  const BallScene scene;
  ObjectField first = MakeField(scene, DistanceConfig()), second = MakeField(scene, DistanceConfig());
  first.Train(30, 2);
  second.Train(10, 2);
  second.Train(20, 2);
  EXPECT_EQ(RawOnGrid(first.Snapshot()), RawOnGrid(second.Snapshot()));
}

TEST(ObjectFieldDistanceTest, ContinuesInAnotherBoxAndWithMoreViews) {
  const BallScene scene;
  ObjectField field(DistanceConfig(), scene.object, 1);
  Cuboid box = scene.Box();
  ASSERT_TRUE(field.SetBox(box).ok());
  const std::vector<ObjectView> views = scene.Views();
  for (int i = 0; i < 6; ++i) ASSERT_TRUE(field.AddView(views[static_cast<size_t>(i)]).ok());
  field.Train(100, 1);
  box.half_extents *= 1.25;
  ASSERT_TRUE(field.SetBox(box).ok());
  for (size_t i = 6; i < views.size(); ++i) ASSERT_TRUE(field.AddView(views[i]).ok());
  field.Train(static_cast<int>(field.AllowedSteps(true) - field.steps()), 1);
  EXPECT_GT(field.steps(), 100u) << "training did not restart";
  EXPECT_LT(BallSurfaceError(scene, field.Snapshot()), 0.05);
}

TEST(ObjectFieldDistanceTest, TheSurfaceSharpensOverThePlan) {
  const BallScene scene;
  const NerfConfig config = DistanceConfig();
  ObjectField field = MakeField(scene, config);
  field.Train(20, 1);
  const SurfaceOptics early = field.Snapshot().optics;
  field.Train(180, 1);
  const SurfaceOptics late = field.Snapshot().optics;
  EXPECT_GT(late.surface_density_per_mu, 5 * early.surface_density_per_mu);
  EXPECT_NEAR(late.raw_per_efold, 1 / (config.final_sharpness * kDistancePerRaw), 1e-4);
}

}  // namespace romap::nerf::object_field_distance_test
