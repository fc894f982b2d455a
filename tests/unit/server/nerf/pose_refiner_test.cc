#include "server/nerf/pose_refiner.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/nerf/object_field.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::pose_refiner_test {

using testing_support::BallScene;
using testing_support::SmallFieldConfig;

NerfConfig ShortConfig() {
  NerfConfig config = SmallFieldConfig();
  config.full_budget_steps = 200;
  config.max_extra_steps = 0;
  return config;
}

BallScene Scene() { return {.views = 14, .size_px = 120}; }

// The view with its camera rotated so that the object appears shifted.
ObjectView Shifted(ObjectView view, double right_px, double down_px) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(-right_px / view.camera.fx_px, Eigen::Vector3d::UnitY()) *
                                Eigen::AngleAxisd(down_px / view.camera.fy_px, Eigen::Vector3d::UnitX()));
  view.T_world_camera = {view.T_world_camera.rotation() * turn, view.T_world_camera.translation()};
  return view;
}

ObjectField Trained(const BallScene& scene, const std::vector<ObjectView>& views, const NerfConfig& config,
                    int steps = 200) {
  ObjectField field(config, scene.object, 1);
  EXPECT_TRUE(field.SetBox(scene.Box()).ok());
  for (const ObjectView& view : views) EXPECT_TRUE(field.AddView(view).ok());
  field.Train(steps, 1);
  return field;
}

// The distance, in each view of the field, of the object's center from its true image position.
std::vector<double> Errors_px(const BallScene& scene, const ObjectField& field) {
  std::vector<double> errors_px;
  const std::vector<TrainingCamera> cameras = field.Snapshot().cameras;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const ObjectView truth = scene.View(static_cast<int>(i));
    const Eigen::Vector3d center = truth.T_world_camera.Inverse() * scene.Center();
    const Eigen::Vector3d found = cameras[i].T_camera_object.translation();
    errors_px.push_back((truth.camera.Project(found) - truth.camera.Project(center)).norm());
  }
  return errors_px;
}

double Rms(const std::vector<double>& values) {
  double square = 0;
  for (double value : values) square += value * value;
  return std::sqrt(square / static_cast<double>(values.size()));
}

// Uncorrelated errors of two pixels.
std::vector<ObjectView> NoisyViews(const BallScene& scene) {
  std::vector<ObjectView> views;
  for (int i = 0; i < scene.views; ++i) {
    views.push_back(Shifted(scene.View(i), i % 2 == 0 ? 1.5 : -1.5, i % 4 < 2 ? 1.3 : -1.3));
  }
  return views;
}

TEST(PoseRefinerTest, CorrectsSmallErrorsOfAllViews) {
  const BallScene scene = Scene();
  NerfConfig config = ShortConfig();
  const std::vector<double> refined_px = Errors_px(scene, Trained(scene, NoisyViews(scene), config));
  config.pose_prior_px = 0;
  const std::vector<double> given_px = Errors_px(scene, Trained(scene, NoisyViews(scene), config));
  ASSERT_EQ(refined_px.size(), 14u);
  EXPECT_NEAR(Rms(given_px), std::hypot(1.5, 1.3), 0.1) << "refinement is disabled";
  EXPECT_LT(Rms(refined_px), 0.4 * Rms(given_px));
}

TEST(PoseRefinerTest, CorrectsOneViewAndKeepsTheOthers) {
  const BallScene scene = Scene();
  std::vector<ObjectView> views = scene.Views();
  views[5] = Shifted(views[5], 2.5, -1);
  const std::vector<double> errors_px = Errors_px(scene, Trained(scene, views, ShortConfig()));
  ASSERT_EQ(errors_px.size(), 14u);
  for (size_t i = 0; i < errors_px.size(); ++i) EXPECT_LT(errors_px[i], i == 5 ? 1.5 : 0.5) << i;
}

TEST(PoseRefinerTest, DoesNotMoveAllViewsTogether) {
  const BallScene scene = Scene();
  const std::vector<ObjectView> views = NoisyViews(scene);
  const FieldSnapshot snapshot = Trained(scene, views, ShortConfig(), 50).Snapshot();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero(), turn = Eigen::Vector3d::Zero();
  double growth = 0, moved = 0;
  for (size_t i = 0; i < views.size(); ++i) {
    const SE3<Object, Camera> T_given = snapshot.T_world_object.Inverse() * views[i].T_world_camera;
    const SE3<Object, Object> change = snapshot.cameras[i].T_camera_object.Inverse() * T_given.Inverse();
    const Eigen::AngleAxisd angle(change.rotation());
    turn += angle.angle() * angle.axis();
    shift += change.translation();
    growth += change.translation().dot(T_given.translation());
    moved += change.translation().norm();
  }
  ASSERT_GT(moved, 1e-3);
  EXPECT_LT(shift.norm(), 1e-6);
  EXPECT_LT(turn.norm(), 1e-6);
  EXPECT_NEAR(growth, 0, 1e-6);
}

TEST(PoseRefinerTest, ASmallCorrectionKeepsTheRefinement) {
  const BallScene scene = Scene();
  const std::vector<ObjectView> views = NoisyViews(scene);
  ObjectField field = Trained(scene, views, ShortConfig());
  const std::vector<double> before_px = Errors_px(scene, field);
  ASSERT_TRUE(field.CorrectView({views[3].keyframe, Shifted(views[3], 0.2, 0).T_world_camera}).ok());
  EXPECT_NEAR(Errors_px(scene, field)[3], before_px[3], 0.25);
  const ObjectView far = Shifted(views[3], 8, 0);
  ASSERT_TRUE(field.CorrectView({far.keyframe, far.T_world_camera}).ok());
  const SE3<Camera, Object> T_far = far.T_world_camera.Inverse() * field.Snapshot().T_world_object;
  EXPECT_TRUE(field.Snapshot().cameras[3].T_camera_object.Matrix().isApprox(T_far.Matrix(), 1e-9));
}

TEST(PoseRefinerTest, FewViewsAreNotRefined) {
  BallScene scene = Scene();
  scene.views = 5;
  std::vector<ObjectView> views = scene.Views();
  views[1] = Shifted(views[1], 2, 0);
  const std::vector<double> errors_px = Errors_px(scene, Trained(scene, views, ShortConfig(), 100));
  EXPECT_NEAR(errors_px[1], 2, 0.05);
  EXPECT_LT(errors_px[0], 1e-6);
}

}  // namespace romap::nerf::pose_refiner_test
