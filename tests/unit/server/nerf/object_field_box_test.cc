// Tests ObjectField after changes of the cuboid: the trained field must be transferred to the new box.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "common/map_motion.h"
#include "server/nerf/object_field.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::object_field_box_test {

using testing_support::BallScene;
using testing_support::BallSurfaceError;
using testing_support::RawOnGrid;

NerfConfig ShortConfig() {
  NerfConfig config;
  config.full_budget_steps = 150;
  config.max_extra_steps = 0;
  return config;
}

ObjectField MakeField(const BallScene& scene, const Cuboid& box, uint64_t seed = 1) {
  ObjectField field(ShortConfig(), scene.object, seed);
  EXPECT_TRUE(field.SetBox(box).ok());
  for (const ObjectView& view : scene.Views()) EXPECT_TRUE(field.AddView(view).ok());
  return field;
}

// Scales the box of the ball along its axes and rotates it, about its center.
struct Change {
  std::string name;
  Eigen::Vector3d scale{1, 1, 1};
  double turn_rad = 0;

  Cuboid Apply(const Cuboid& box) const {
    Cuboid changed = box;
    changed.half_extents = box.half_extents.cwiseProduct(scale);
    const SE3<Object, Object> T_old_new(Eigen::Quaterniond(Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ())),
                                        Eigen::Vector3d::Zero());
    changed.T_world_object = box.T_world_object * T_old_new;
    return changed;
  }
};

class ObjectFieldBoxChangeTest : public ::testing::TestWithParam<Change> {};

TEST_P(ObjectFieldBoxChangeTest, TransferredFieldReachesTheAccuracyOfAFieldTrainedInTheNewBox) {
  const BallScene scene;
  const auto whole = static_cast<int>(ShortConfig().full_budget_steps);
  ObjectField right = MakeField(scene, scene.Box());
  const double new_loss = right.Train(1, 1).color_loss;
  right.Train(whole - 1, 1);
  const double right_error = BallSurfaceError(scene, right.Snapshot());

  ObjectField field = MakeField(scene, GetParam().Apply(scene.Box()));
  field.Train(99, 1);
  const double loss_before = field.Train(1, 1).color_loss;
  const double error_before = BallSurfaceError(scene, field.Snapshot());
  ASSERT_TRUE(field.SetBox(scene.Box()).ok());
  EXPECT_EQ(field.steps(), 100u);
  EXPECT_LT(BallSurfaceError(scene, field.Snapshot()), error_before + 0.02);
  const double loss_after = field.Train(1, 1).color_loss;
  EXPECT_LT(loss_after, 0.4 * new_loss);
  EXPECT_LT(loss_after, 2.5 * loss_before + 0.01);

  const auto rest = static_cast<int>(field.AllowedSteps(true) - field.steps());
  EXPECT_LE(rest, whole);
  field.Train(rest, 1);
  EXPECT_LT(BallSurfaceError(scene, field.Snapshot()), 1.2 * right_error + 0.01);
}

TEST_P(ObjectFieldBoxChangeTest, SnapshotHasTheNewBoxImmediately) {
  const BallScene scene;
  ObjectField field = MakeField(scene, GetParam().Apply(scene.Box()));
  field.Train(10, 1);
  ASSERT_TRUE(field.SetBox(scene.Box()).ok());
  const FieldSnapshot snapshot = field.Snapshot();
  const FieldSnapshot right = MakeField(scene, scene.Box()).Snapshot();
  if (snapshot.box_half_extents.isApprox(right.box_half_extents, 1e-5f)) {
    EXPECT_TRUE(snapshot.T_world_object.Matrix().isApprox(right.T_world_object.Matrix(), 1e-12));
    ObjectField trained = MakeField(scene, scene.Box());
    trained.Train(1, 1);  // views are used from the first step on
    const std::vector<uint8_t>& hull = trained.Snapshot().hull.bits;
    int differ = 0;
    for (size_t i = 0; i < hull.size(); ++i) differ += hull[i] != snapshot.hull.bits[i];
    EXPECT_LT(differ, static_cast<int>(hull.size() / 500));  // layers may be trimmed once steps were done
  } else {
    EXPECT_THAT(GetParam().name, ::testing::EndsWith("10Percent")) << "only a box that still fits is kept";
  }
  std::vector<float> raw(1);
  const Eigen::Vector3f corner = 0.999f * snapshot.box_half_extents;
  snapshot.field->Sample(std::vector<Eigen::Vector3f>{corner}, raw, {});
  EXPECT_GT(raw[0], -100) << "the field is defined in the whole new box";
}

// "Grows30Percent": the first box of the field is too small by that much.
INSTANTIATE_TEST_SUITE_P(Boxes, ObjectFieldBoxChangeTest,
                         ::testing::Values(Change{"Grows10Percent", {1 / 1.1, 1, 1}},
                                           Change{"Grows30Percent", {1, 1 / 1.3, 1}},
                                           Change{"Grows60Percent", {1, 1, 1 / 1.6}},
                                           Change{"Shrinks10Percent", {1.1, 1, 1}},
                                           Change{"ShrinksToTheThird", {1.5, 2, 1}}, Change{"Turns", {1, 1, 1}, 0.6},
                                           Change{"TurnsAndGrows", {0.8, 1, 0.9}, -0.4}),
                         [](const auto& info) { return info.param.name; });

TEST(ObjectFieldBoxTest, TransferKeepsTheFieldInPlace) {
  const BallScene scene;
  ObjectField field = MakeField(scene, scene.Box());
  field.Train(60, 1);
  const FieldSnapshot before = field.Snapshot();
  Cuboid small = Change{"", {0.6, 0.8, 0.7}, 0.3}.Apply(scene.Box());
  ASSERT_TRUE(field.SetBox(small).ok());
  const FieldSnapshot after = field.Snapshot();
  ASSERT_FALSE(after.box_half_extents.isApprox(before.box_half_extents, 0.01f));
  std::vector<Eigen::Vector3f> in_new, in_old;
  const SE3<Object, Object> T_old_new = before.T_world_object.Inverse() * after.T_world_object;
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d share(std::sin(i), std::sin(1.7 * i), std::cos(2.3 * i));
    const Eigen::Vector3d p = 0.95 * share.cwiseProduct(after.box_half_extents.cast<double>());
    const Eigen::Vector3d p_old = T_old_new * p;
    if ((p_old.cwiseAbs().array() > 0.99 * before.box_half_extents.cast<double>().array()).any()) continue;
    in_new.push_back(p.cast<float>());
    in_old.push_back(p_old.cast<float>());
  }
  ASSERT_GT(in_new.size(), 100u);
  std::vector<float> raw_new(in_new.size()), raw_old(in_old.size());
  after.field->Sample(in_new, raw_new, {});
  before.field->Sample(in_old, raw_old, {});
  for (size_t i = 0; i < raw_new.size(); ++i) EXPECT_NEAR(raw_new[i], raw_old[i], 0.02) << i;
}

TEST(ObjectFieldBoxTest, CorrectionsComposeWithBoxChanges) {
  const BallScene scene;
  const Eigen::AngleAxisd turn(0.35, Eigen::Vector3d(0.1, -0.1, 1).normalized());
  const Sim3<World, World> S(1.3, Eigen::Quaterniond(turn), {2.0, -1.0, 0.5});
  const Cuboid small = Change{"", {0.75, 1, 1}}.Apply(scene.Box());
  ObjectField moved = MakeField(scene, small), still = MakeField(scene, small);
  for (ObjectField* field : {&moved, &still}) field->Train(10, 1);
  moved.Move(S);
  ASSERT_TRUE(moved.SetBox(Moved(S, scene.Box())).ok());
  ASSERT_TRUE(still.SetBox(scene.Box()).ok());
  for (ObjectField* field : {&moved, &still}) field->Train(10, 1);
  moved.Move(S.Inverse());
  moved.Move(S);
  const FieldSnapshot a = moved.Snapshot(), b = still.Snapshot();
  EXPECT_EQ(a.steps, 20u);
  EXPECT_TRUE(a.T_world_object.Matrix().isApprox(S.Moved(b.T_world_object).Matrix(), 1e-9));
  EXPECT_TRUE(a.box_half_extents.isApprox(1.3f * b.box_half_extents, 1e-5f));
  const std::vector<float> raw_a = RawOnGrid(a, 0.98F), raw_b = RawOnGrid(b, 0.98F);
  for (size_t i = 0; i < raw_a.size(); ++i) EXPECT_NEAR(raw_a[i], raw_b[i], 0.05) << i;
}

// An object gets many boxes while the camera moves around it.
TEST(ObjectFieldBoxTest, ManyBoxChangesDoNotDegradeTheField) {
  const BallScene scene;
  const auto whole = static_cast<int>(ShortConfig().full_budget_steps);
  ObjectField right = MakeField(scene, scene.Box());
  right.Train(whole, 1);
  ObjectField field = MakeField(scene, Change{"", {0.8, 1, 1}}.Apply(scene.Box()));
  for (int i = 0; i < 14; ++i) {
    field.Train(10, 1);
    const Change change{"", i % 2 == 0 ? Eigen::Vector3d(0.75, 1.2, 1) : Eigen::Vector3d(1.2, 0.75, 1)};
    ASSERT_TRUE(field.SetBox(change.Apply(scene.Box())).ok());
  }
  ASSERT_TRUE(field.SetBox(scene.Box()).ok());
  field.Train(static_cast<int>(field.AllowedSteps(true) - field.steps()), 1);
  EXPECT_LT(BallSurfaceError(scene, field.Snapshot()), 1.5 * BallSurfaceError(scene, right.Snapshot()) + 0.02);
}

TEST(ObjectFieldBoxTest, IsDeterministic) {
  const BallScene scene;
  const auto train = [&](int threads) {
    ObjectField field = MakeField(scene, Change{"", {0.7, 1, 1}}.Apply(scene.Box()));
    field.Train(12, threads);
    EXPECT_TRUE(field.SetBox(Change{"", {1, 1, 1}, 0.5}.Apply(scene.Box())).ok());
    field.Train(12, threads);
    EXPECT_TRUE(field.SetBox(scene.Box()).ok());
    field.Train(12, threads);
    return RawOnGrid(field.Snapshot());
  };
  EXPECT_EQ(train(1), train(1));
  EXPECT_EQ(train(2), train(2));
}

}  // namespace romap::nerf::object_field_box_test
