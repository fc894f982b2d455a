// Tests ObjectField after map corrections: the field must move with the map and keep its trained state.

#include <gtest/gtest.h>

#include <cmath>

#include "common/angles.h"
#include "common/map_motion.h"
#include "server/nerf/object_field.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::object_field_correction_test {

using testing_support::BallScene;
using testing_support::BallSurfaceError;
using testing_support::RawOnGrid;
using testing_support::SmallFieldConfig;

NerfConfig ShortConfig() {
  NerfConfig config = SmallFieldConfig();
  config.full_budget_steps = 100;
  config.max_extra_steps = 0;
  return config;
}

ObjectField MakeField(const BallScene& scene, const std::vector<ObjectView>& views,
                      const NerfConfig& config = ShortConfig()) {
  ObjectField field(config, scene.object, 1);
  EXPECT_TRUE(field.SetBox(scene.Box()).ok());
  for (const ObjectView& view : views) EXPECT_TRUE(field.AddView(view).ok());
  return field;
}

// A loop closure: rotation by 20 degrees about a tilted axis, shift and scale.
Sim3<World, World> LoopClosure() {
  const Eigen::AngleAxisd turn(20 * kRadPerDeg, Eigen::Vector3d(0.1, -0.1, 1).normalized());
  return {1.3, Eigen::Quaterniond(turn), {2.0, -1.0, 0.5}};
}

TEST(ObjectFieldCorrectionTest, MoveTransformsTheField) {
  const BallScene scene;
  ObjectField field = MakeField(scene, scene.Views());
  field.Train(40, 1);
  const FieldSnapshot before = field.Snapshot();
  const Sim3<World, World> S = LoopClosure();
  field.Move(S);
  ASSERT_TRUE(field.SetBox(Moved(S, scene.Box())).ok());
  EXPECT_EQ(field.steps(), 40u);
  const FieldSnapshot after = field.Snapshot();
  EXPECT_TRUE(after.T_world_object.Matrix().isApprox(S.Moved(before.T_world_object).Matrix(), 1e-9));
  EXPECT_TRUE(after.box_half_extents.isApprox(1.3f * before.box_half_extents, 1e-5f));
  EXPECT_TRUE(
      after.S_new_first.Moved(SE3<World, Object>()).Matrix().isApprox(S.Moved(SE3<World, Object>()).Matrix(), 1e-9));
  EXPECT_EQ(after.hull.bits, before.hull.bits);
  EXPECT_NEAR(1.3f * after.optics.surface_density_per_mu, before.optics.surface_density_per_mu, 1e-4f);
  ASSERT_EQ(after.cameras.size(), before.cameras.size());
  for (size_t i = 0; i < after.cameras.size(); ++i) {
    const SE3<Camera, Object>& T_before = before.cameras[i].T_camera_object;
    const SE3<Camera, Object> T_scaled(T_before.rotation(), 1.3 * T_before.translation());
    EXPECT_TRUE(after.cameras[i].T_camera_object.Matrix().isApprox(T_scaled.Matrix(), 1e-5));
  }
  const std::vector<float> raw_before = RawOnGrid(before, 0.98F), raw_after = RawOnGrid(after, 0.98F);
  for (size_t i = 0; i < raw_before.size(); ++i) EXPECT_NEAR(raw_before[i], raw_after[i], 0.02) << i;
}

TEST(ObjectFieldCorrectionTest, TrainingContinuesInTheCorrectedWorld) {
  BallScene scene;
  scene.with_depth = true;
  const std::vector<ObjectView> views = scene.Views();
  const std::vector<ObjectView> first_half(views.begin(), views.begin() + 6);
  ObjectField field = MakeField(scene, first_half, NerfConfig{});
  field.Train(60, 1);
  const Sim3<World, World> S = LoopClosure();
  field.Move(S);
  for (size_t i = 6; i < views.size(); ++i) ASSERT_TRUE(field.AddView(Moved(S, views[i])).ok());
  ASSERT_TRUE(field.SetBox(Moved(S, scene.Box())).ok());
  EXPECT_EQ(field.views(), scene.views);
  field.Train(120, 1);
  EXPECT_EQ(field.steps(), 180u);

  BallScene moved = scene;
  moved.radius_mu = S.scale() * scene.radius_mu;
  EXPECT_LT(BallSurfaceError(moved, field.Snapshot()), 0.06);
}

TEST(ObjectFieldCorrectionTest, MoveDoesNotChangeTraining) {
  const BallScene scene;
  ObjectField moved = MakeField(scene, scene.Views()), still = MakeField(scene, scene.Views());
  moved.Train(10, 1);
  still.Train(10, 1);
  moved.Move(LoopClosure());
  moved.Train(10, 1);
  still.Train(10, 1);
  const std::vector<float> raw_moved = RawOnGrid(moved.Snapshot(), 0.98F),
                           raw_still = RawOnGrid(still.Snapshot(), 0.98F);
  for (size_t i = 0; i < raw_moved.size(); ++i) EXPECT_NEAR(raw_moved[i], raw_still[i], 0.02) << i;
}

TEST(ObjectFieldCorrectionTest, ASlightlyTiltedBoxIsKept) {
  BallScene scene;
  Cuboid box = scene.Box();
  box.half_extents.x() *= 4;  // the ends of a tilted long box move far up and down
  ObjectField field(ShortConfig(), scene.object, 1);
  ASSERT_TRUE(field.SetBox(box).ok());
  for (const ObjectView& view : scene.Views()) ASSERT_TRUE(field.AddView(view).ok());
  field.Train(5, 1);
  const Sim3<World, World> S(1, Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY())), {0, 0, 0});
  field.Move(S);
  // The cuboid of the corrected map moves too, but stays upright.
  box.T_world_object = {box.T_world_object.rotation(), S * box.T_world_object.translation()};
  ASSERT_TRUE(field.SetBox(box).ok());
  EXPECT_EQ(field.steps(), 5u);
  const SE3<World, Object> T_world_tilted = field.Snapshot().T_world_object;
  // A rotation about the vertical by the same angle needs a new box, which is upright.
  box.T_world_object =
      box.T_world_object * SE3<Object, Object>(Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ())),
                                               Eigen::Vector3d::Zero());
  ASSERT_TRUE(field.SetBox(box).ok());
  EXPECT_EQ(field.steps(), 5u);
  const auto up = [](const SE3<World, Object>& T) { return (T.rotation() * Eigen::Vector3d::UnitZ()).z(); };
  EXPECT_LT(up(T_world_tilted), std::cos(0.09));
  EXPECT_NEAR(up(field.Snapshot().T_world_object), 1, 1e-9);
}

// In every third view the object appears too low, in the others too high.
std::vector<ObjectView> WithWrongPoses(const BallScene& scene, double error_rad) {
  std::vector<ObjectView> views = scene.Views();
  for (size_t i = 0; i < views.size(); ++i) {
    const double turn_rad = i % 3 == 0 ? error_rad : -error_rad;
    const SE3<Camera, Camera> error(Eigen::Quaterniond(Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitX())),
                                    Eigen::Vector3d::Zero());
    views[i].T_world_camera = views[i].T_world_camera * error;
  }
  return views;
}

TEST(ObjectFieldCorrectionTest, CorrectedPosesImproveTheField) {
  const BallScene scene;
  NerfConfig config;
  config.pose_prior_px = 0;  // otherwise training corrects the poses itself
  ObjectField field = MakeField(scene, WithWrongPoses(scene, 0.008), config);
  const uint64_t planned = field.AllowedSteps(true);
  field.Train(static_cast<int>(planned), 1);
  const FieldSnapshot before = field.Snapshot();

  for (const ObjectView& view : scene.Views()) {
    ASSERT_TRUE(field.CorrectView({view.keyframe, view.T_world_camera}).ok());
  }
  EXPECT_EQ(field.views(), scene.views);
  EXPECT_EQ(field.steps(), planned) << "training does not restart";
  const uint64_t more = field.AllowedSteps(true) - planned;
  EXPECT_LE(more, static_cast<uint64_t>(config.full_budget_steps));
  field.Train(static_cast<int>(more), 1);
  const FieldSnapshot after = field.Snapshot();
  EXPECT_LT(BallSurfaceError(scene, after), 0.7 * BallSurfaceError(scene, before));
  EXPECT_LT(after.loss, 0.5 * before.loss);
}

TEST(ObjectFieldCorrectionTest, SmallCorrectionsAddFewSteps) {
  const BallScene scene;
  ObjectField field = MakeField(scene, WithWrongPoses(scene, 0.0005));
  const uint64_t planned = field.AllowedSteps(true);
  field.Train(static_cast<int>(planned), 1);
  ASSERT_TRUE(field.CorrectView({KeyframeId{1}, scene.View(0).T_world_camera}).ok());
  EXPECT_EQ(field.AllowedSteps(true), planned + static_cast<uint64_t>(ShortConfig().refine_steps_per_view));
}

TEST(ObjectFieldCorrectionTest, InvalidPosesAndUnknownViewsChangeNothing) {
  const BallScene scene;
  ObjectField field = MakeField(scene, scene.Views());
  const Eigen::Vector3d nan = Eigen::Vector3d::Constant(NAN);
  EXPECT_FALSE(field.CorrectView({KeyframeId{1}, {Eigen::Quaterniond::Identity(), nan}}).ok());
  EXPECT_TRUE(field.CorrectView({KeyframeId{999}, SE3<World, Camera>()}).ok());
  EXPECT_EQ(field.views(), scene.views);
  field.Train(2, 1);
  EXPECT_EQ(field.steps(), 2u);
}

}  // namespace romap::nerf::object_field_correction_test
