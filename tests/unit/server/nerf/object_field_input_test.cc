// Invalid and wrong input of ObjectField, and its warnings.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "common/angles.h"
#include "server/nerf/object_field.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::object_field_input_test {

using ::testing::HasSubstr;
using ::testing::Not;
using testing_support::BallScene;
using testing_support::BallSurfaceError;
using testing_support::RawOnGrid;
using testing_support::SmallFieldConfig;

NerfConfig SmallConfig() {
  NerfConfig config = SmallFieldConfig();
  config.full_budget_steps = 150;
  return config;
}

// Trains long enough to distinguish a correct shape from a wrong one.
NerfConfig ShapeConfig() {
  NerfConfig config;
  config.full_budget_steps = 120;
  config.contrast_weight = 0;  // helps only after more steps
  config.max_extra_steps = 0;
  return config;
}

void TrainToCompletion(ObjectField& field) {
  while (field.AllowedSteps(true) > field.steps()) {
    field.Train(static_cast<int>(std::min<uint64_t>(20, field.AllowedSteps(true) - field.steps())), 1);
  }
}

ObjectField TrainedOn(const BallScene& scene, const std::vector<ObjectView>& views,
                      const NerfConfig& config = ShapeConfig()) {
  ObjectField field(config, scene.object, 1);
  EXPECT_TRUE(field.SetBox(scene.Box()).ok());
  for (const ObjectView& view : views) EXPECT_TRUE(field.AddView(view).ok());
  TrainToCompletion(field);
  return field;
}

void Turn(ObjectView& view, double angle_deg) {
  const Eigen::AngleAxisd turn(angle_deg * kRadPerDeg, Eigen::Vector3d::UnitY());
  view.T_world_camera = view.T_world_camera * SE3<Camera, Camera>(Eigen::Quaterniond(turn), Eigen::Vector3d::Zero());
}

TEST(ObjectFieldInputTest, ExcludesAViewWithAWrongPose) {
  BallScene scene;
  scene.views = 16;
  std::vector<ObjectView> views = scene.Views();
  const ObjectField right = TrainedOn(scene, views);
  EXPECT_EQ(right.Warning(), "");
  Turn(views[6], 5);
  ObjectField field = TrainedOn(scene, views);
  const FieldSnapshot snapshot = field.Snapshot();
  EXPECT_THAT(snapshot.warning, HasSubstr("contradict the others: keyframe/7"));
  EXPECT_EQ(snapshot.cameras.size(), 15u);
  const double right_error = BallSurfaceError(scene, right.Snapshot());
  EXPECT_LT(BallSurfaceError(scene, snapshot), 1.5 * right_error + 0.03);

  // After a correction of its pose, the view is trusted again.
  ASSERT_TRUE(field.CorrectView({views[6].keyframe, scene.View(6).T_world_camera}).ok());
  EXPECT_EQ(field.Warning(), "");
  TrainToCompletion(field);
  EXPECT_EQ(field.Warning(), "");
  EXPECT_EQ(field.Snapshot().cameras.size(), 16u);
}

TEST(ObjectFieldInputTest, ExcludesAViewWithTheMaskOfAnotherObject) {
  BallScene scene;
  scene.views = 16;
  std::vector<ObjectView> views = scene.Views();
  ObjectView& wrong = views[4];
  wrong.ray_kind = cv::Mat(wrong.roi_px.size(), CV_8UC1, cv::Scalar(static_cast<int>(RayKind::kBackground)));
  wrong.ray_kind(cv::Rect(0, 0, 20, 24)).setTo(static_cast<int>(RayKind::kObject));
  const FieldSnapshot snapshot = TrainedOn(scene, views).Snapshot();
  EXPECT_THAT(snapshot.warning, HasSubstr("contradict the others: keyframe/5"));
  EXPECT_LT(BallSurfaceError(scene, snapshot), 0.06);
}

TEST(ObjectFieldInputTest, NewMasksOfTheSameKeyframesChangeTheField) {
  // The new masks exclude the lower part of the ball.
  const BallScene scene;
  std::vector<ObjectView> views = scene.Views();
  ObjectField field = TrainedOn(scene, views);
  const Eigen::Vector3d eye_below = scene.Box().T_world_object.Inverse() * scene.View(1).T_world_camera.translation();
  // The highest raw value inside the hull near the surface that faces a low camera.
  const auto raw_below = [&] {
    const FieldSnapshot snapshot = field.Snapshot();
    const int n = snapshot.hull.resolution;
    std::vector<Eigen::Vector3f> points;
    for (double share = 0.85; share < 1; share += 0.02) {
      const Eigen::Vector3f point = (share * scene.radius_mu * eye_below.normalized()).cast<float>();
      const Eigen::Vector3i cell =
          ((point.cwiseQuotient(snapshot.box_half_extents).array() + 1) * 0.5f * n).cast<int>();
      if (snapshot.hull.bits[static_cast<size_t>((cell.z() * n + cell.y()) * n + cell.x())] != 0)
        points.push_back(point);
    }
    std::vector<float> raw(points.size());
    snapshot.field->Sample(points, raw, {});
    return raw.empty() ? -1e4f : *std::ranges::max_element(raw);
  };
  const float level = field.Snapshot().surface_level;
  EXPECT_GT(raw_below(), level);
  for (ObjectView& view : views) {
    view.ray_kind = view.ray_kind.clone();
    for (int v = 0; v < scene.size_px; ++v) {
      for (int u = 0; u < scene.size_px; ++u) {
        const Eigen::Vector3d ray = view.T_world_camera.rotation() * view.camera.Unproject(u, v);
        const Eigen::Vector3d eye = view.T_world_camera.translation() - scene.Center();
        const double along = -eye.dot(ray) / ray.squaredNorm();
        const bool low = (eye + along * ray).z() < -0.2 * scene.radius_mu;
        if (low) view.ray_kind.at<uint8_t>(v, u) = static_cast<uint8_t>(RayKind::kBackground);
      }
    }
    ASSERT_TRUE(field.AddView(view).ok());
  }
  EXPECT_EQ(field.views(), scene.views) << "they replace the views of the same keyframes";
  TrainToCompletion(field);
  EXPECT_LT(raw_below(), level);
}

TEST(ObjectFieldInputTest, LearnsTheShapeFromBlackImages) {
  const BallScene scene;
  std::vector<ObjectView> views = scene.Views();
  for (ObjectView& view : views) view.color_bgr = cv::Mat::zeros(view.color_bgr.size(), CV_8UC3);
  const FieldSnapshot snapshot = TrainedOn(scene, views).Snapshot();
  EXPECT_THAT(snapshot.warning, HasSubstr("black in 12 of 12 views"));
  EXPECT_LT(BallSurfaceError(scene, snapshot), 0.12);
}

TEST(ObjectFieldInputTest, WarnsAboutABoxThatMissesTheObject) {
  const BallScene scene;
  ObjectField field(ShapeConfig(), scene.object, 1);
  Cuboid box = scene.Box();
  box.T_world_object = {box.T_world_object.rotation(),
                        box.T_world_object.translation() + Eigen::Vector3d(0, 0, 2.6 * scene.radius_mu)};
  ASSERT_TRUE(field.SetBox(box).ok());
  for (const ObjectView& view : scene.Views()) ASSERT_TRUE(field.AddView(view).ok());
  TrainToCompletion(field);
  const FieldSnapshot snapshot = field.Snapshot();
  EXPECT_THAT(snapshot.warning, HasSubstr("miss the object's box"));
  for (float raw : RawOnGrid(snapshot)) EXPECT_TRUE(std::isfinite(raw));
  ASSERT_TRUE(field.SetBox(scene.Box()).ok());
  TrainToCompletion(field);
  EXPECT_THAT(field.Warning(), Not(HasSubstr("miss the object's box")));
  EXPECT_LT(BallSurfaceError(scene, field.Snapshot()), 0.06);
}

TEST(ObjectFieldInputTest, WarnsAboutRejectedInput) {
  const BallScene scene;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  ObjectField field(SmallConfig(), scene.object, 1);
  Cuboid box = scene.Box();
  box.half_extents.x() = nan;
  EXPECT_FALSE(field.SetBox(box).ok());
  EXPECT_THAT(field.Warning(), HasSubstr("half extents must be positive and finite"));
  EXPECT_FALSE(field.AddView(scene.View(0)).ok());
  EXPECT_THAT(field.Warning(), HasSubstr("set the box before adding views"));
  ASSERT_TRUE(field.SetBox(scene.Box()).ok());
  ObjectView view = scene.View(0);
  view.ray_kind = cv::Mat::zeros(view.roi_px.size(), CV_8UC1);
  EXPECT_FALSE(field.AddView(view).ok());
  EXPECT_EQ(field.Warning(), "2 views rejected; last error: view of object/7 in keyframe/1: mask is empty");
  view.ray_kind.at<uint8_t>(30, 30) = static_cast<uint8_t>(RayKind::kObject);
  EXPECT_FALSE(field.AddView(view).ok());
  EXPECT_THAT(field.Warning(), HasSubstr("mask must have at least 16 object pixels, has 1"));
  view = scene.View(0);
  view.camera.cx_px = nan;
  EXPECT_FALSE(field.AddView(view).ok());
  EXPECT_EQ(field.views(), 0);
  field.Move({nan, Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero()});
  EXPECT_THAT(field.Warning(), HasSubstr("a map correction with values that are not finite was ignored"));
  ASSERT_TRUE(field.AddView(scene.View(0)).ok());
  EXPECT_TRUE(field.Snapshot().T_world_object.IsFinite());
}

TEST(ObjectFieldInputTest, IgnoresInvalidDepthValues) {
  BallScene scene;
  scene.with_depth = true;
  std::vector<ObjectView> views = scene.Views();
  const float inf = std::numeric_limits<float>::infinity();
  const std::array<float, 6> invalid = {NAN, inf, -inf, 0, -1, std::numeric_limits<float>::max()};
  for (ObjectView& view : views) {
    for (int v = 0; v < scene.size_px; v += 2) {
      for (int u = 0; u < scene.size_px; ++u)
        view.depth_mu.at<float>(v, u) = invalid[static_cast<size_t>(u) % invalid.size()];
    }
    view.sparse_depth = {{30, 30, NAN}, {NAN, 30, 1}, {30, 30, inf}, {1e30f, 30, 1}, {30, 30, -1}};
  }
  const FieldSnapshot snapshot = TrainedOn(scene, views).Snapshot();
  EXPECT_TRUE(std::isfinite(snapshot.loss));
  for (float raw : RawOnGrid(snapshot)) EXPECT_TRUE(std::isfinite(raw));
  EXPECT_LT(BallSurfaceError(scene, snapshot), 0.08);
}

TEST(ObjectFieldInputTest, IgnoresDepthOfAWrongScale) {
  BallScene scene;
  scene.with_depth = true;
  std::vector<ObjectView> views = scene.Views();
  for (ObjectView& view : views) view.depth_mu = view.depth_mu * 1.1;
  const FieldSnapshot snapshot = TrainedOn(scene, views).Snapshot();
  EXPECT_THAT(snapshot.warning, HasSubstr("depth images ignored"));
  EXPECT_LT(BallSurfaceError(scene, snapshot), 0.06);
}

TEST(ObjectFieldInputTest, DoesNotDependOnTheMapUnit) {
  // Equal except for rounding.
  std::vector<std::vector<float>> raws;
  std::vector<std::vector<uint8_t>> hulls;
  for (const double scale : {1.0, 0.01, 100.0}) {
    BallScene scene;
    scene.radius_mu = 0.5 * scale;
    const FieldSnapshot snapshot = TrainedOn(scene, scene.Views(), SmallConfig()).Snapshot();
    raws.push_back(RawOnGrid(snapshot, 0.98f));
    hulls.push_back(snapshot.hull.bits);
    EXPECT_NEAR(snapshot.box_half_extents.x(), 0.55 * scale, 1e-5 * scale);
  }
  for (size_t k = 1; k < raws.size(); ++k) {
    EXPECT_EQ(hulls[0], hulls[k]);
    for (size_t i = 0; i < raws[0].size(); ++i) EXPECT_NEAR(raws[0][i], raws[k][i], 0.05) << i;
  }
}

TEST(ObjectFieldInputTest, TrainsBeyondThePlanWhileTheLossDecreases) {
  const BallScene scene;
  NerfConfig config = SmallConfig();
  config.full_budget_steps = 40;  // too few to converge
  config.min_loss_decrease = 0.05;
  config.max_extra_steps = 2000;
  const ObjectField extended = TrainedOn(scene, scene.Views(), config);
  EXPECT_GT(extended.steps(), 60u);
  EXPECT_LT(extended.steps(), 2040u) << "it converges before";
  config.max_extra_steps = 70;
  EXPECT_LE(TrainedOn(scene, scene.Views(), config).steps(), 110u);
  config.max_extra_steps = 0;
  EXPECT_EQ(TrainedOn(scene, scene.Views(), config).steps(), 40u);
  config.max_extra_steps = 2000;
  config.min_loss_decrease = 1;
  EXPECT_EQ(TrainedOn(scene, scene.Views(), config).steps(), 40u);
}

TEST(ObjectFieldInputTest, EvaluationsDoNotDependOnTheSlices) {
  const BallScene scene;
  std::vector<ObjectView> views = scene.Views();
  Turn(views[5], 5);
  const auto train = [&](int slice) {
    ObjectField field(SmallConfig(), scene.object, 1);
    EXPECT_TRUE(field.SetBox(scene.Box()).ok());
    for (const ObjectView& view : views) EXPECT_TRUE(field.AddView(view).ok());
    for (int done = 0; done < 120; done += slice) field.Train(slice, 1);
    return RawOnGrid(field.Snapshot());
  };
  EXPECT_EQ(train(120), train(8));
}

}  // namespace romap::nerf::object_field_input_test
