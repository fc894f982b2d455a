#include "server/nerf/object_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "common/status.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::object_field_test {

using ::testing::HasSubstr;
using testing_support::BallScene;
using testing_support::BallSurfaceError;
using testing_support::RawOnGrid;
using testing_support::SmallFieldConfig;

ObjectField MakeField(const BallScene& scene, const NerfConfig& config, uint64_t seed = 1) {
  ObjectField field(config, scene.object, seed);
  EXPECT_TRUE(field.SetBox(scene.Box()).ok());
  for (const ObjectView& view : scene.Views()) EXPECT_TRUE(field.AddView(view).ok());
  return field;
}

TEST(ObjectFieldTest, LearnsTheShapeAndColorOfABall) {
  const BallScene scene;
  ObjectField field = MakeField(scene, NerfConfig{});
  field.Train(150, 1);
  const TrainStats stats = field.Train(50, 1);
  EXPECT_EQ(stats.steps, 50);
  EXPECT_LT(stats.color_loss, 0.05);
  const FieldSnapshot snapshot = field.Snapshot();
  EXPECT_EQ(snapshot.steps, 200u);
  EXPECT_EQ(snapshot.views, scene.views);
  EXPECT_LT(BallSurfaceError(scene, snapshot), 0.04);
  // The central pixel of a view shows the surface point closest to the camera.
  for (int i = 0; i < scene.views; ++i) {
    const ObjectView view = scene.View(i);
    const Eigen::Vector3f toward =
        snapshot.cameras[static_cast<size_t>(i)].T_camera_object.Inverse().translation().cast<float>().normalized();
    const std::vector<Eigen::Vector3f> point = {toward * static_cast<float>(0.95 * scene.radius_mu)};
    std::vector<float> raw(1);
    std::vector<Rgb8> rgb(1);
    snapshot.field->Sample(point, raw, rgb);
    EXPECT_GT(raw[0], snapshot.connect_level);
    const cv::Vec3b bgr = view.color_bgr.at<cv::Vec3b>(scene.size_px / 2, scene.size_px / 2);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(rgb[0][static_cast<size_t>(c)], bgr[2 - c], 60) << "view " << i;
  }
}

TEST(ObjectFieldTest, LearnsWithTheSamplingAndLossesOfThePaper) {
  BallScene scene;
  scene.with_depth = true;
  NerfConfig config;
  config.sampling = "uniform";
  config.max_samples_per_ray = 32;
  config.random_background = true;
  ObjectField field = MakeField(scene, config);
  field.Train(150, 1);
  EXPECT_LT(BallSurfaceError(scene, field.Snapshot()), 0.08);
}

TEST(ObjectFieldTest, DoesNotDependOnTheScaleOfTheMap) {
  std::vector<std::vector<float>> raws;
  for (const double radius : {0.5, 0.5 * 128, 0.5 / 128}) {  // powers of two scale without rounding
    BallScene scene;
    scene.radius_mu = radius;
    ObjectField field = MakeField(scene, SmallFieldConfig());
    field.Train(15, 1);
    raws.push_back(RawOnGrid(field.Snapshot()));
  }
  for (size_t i = 0; i < raws[0].size(); ++i) {
    EXPECT_NEAR(raws[0][i], raws[1][i], 0.02) << i;
    EXPECT_NEAR(raws[0][i], raws[2][i], 0.02) << i;
  }
}

TEST(ObjectFieldTest, IsDeterministicForSeedAndThreadCount) {
  BallScene scene;
  scene.views = 5;
  for (const int threads : {1, 2}) {
    ObjectField a = MakeField(scene, SmallFieldConfig()), b = MakeField(scene, SmallFieldConfig());
    a.Train(12, threads);
    b.Train(5, threads);
    b.Train(7, threads);
    EXPECT_EQ(RawOnGrid(a.Snapshot()), RawOnGrid(b.Snapshot())) << threads << " threads";
  }
  ObjectField a = MakeField(scene, SmallFieldConfig(), 1), b = MakeField(scene, SmallFieldConfig(), 2);
  a.Train(3, 1);
  b.Train(3, 1);
  EXPECT_NE(RawOnGrid(a.Snapshot()), RawOnGrid(b.Snapshot()));
}

TEST(ObjectFieldTest, EveryInstructionSetLearnsTheSame) {
  BallScene scene;
  scene.views = 5;
  std::vector<double> losses;
  for (int64_t left = hwy::SupportedTargets(); left != 0; left &= left - 1) {
    hwy::SetSupportedTargetsForTest(left & -left);
    losses.push_back(MakeField(scene, SmallFieldConfig()).Train(25, 1).color_loss);
    hwy::SetSupportedTargetsForTest(0);
  }
  for (const double loss : losses) EXPECT_NEAR(loss, losses[0], 0.02 * losses[0]);
}

TEST(ObjectFieldTest, TrainingDoesNotChangeEarlierSnapshots) {
  BallScene scene;
  scene.views = 4;
  ObjectField field = MakeField(scene, SmallFieldConfig());
  field.Train(5, 1);
  const FieldSnapshot snapshot = field.Snapshot();
  const std::vector<float> before = RawOnGrid(snapshot);
  field.Train(5, 1);
  EXPECT_EQ(RawOnGrid(snapshot), before);
  EXPECT_NE(RawOnGrid(field.Snapshot()), before);
}

TEST(ObjectFieldTest, SamplesOutsideTheBoxAreEmpty) {
  const BallScene scene;
  const ObjectField field = MakeField(scene, SmallFieldConfig());
  const std::vector<Eigen::Vector3f> points = {{2, 0, 0}, {0, 0, 0}, {0, NAN, 0}};
  std::vector<float> raw(3);
  std::vector<Rgb8> rgb(3);
  field.Snapshot().field->Sample(points, raw, rgb);
  EXPECT_EQ(raw[0], -1e4f);
  EXPECT_GT(raw[1], -100.0f);
  EXPECT_EQ(raw[2], -1e4f);
}

TEST(ObjectFieldTest, RejectsInvalidViews) {
  const BallScene scene;
  ObjectField field(SmallFieldConfig(), scene.object, 1);
  ASSERT_TRUE(field.SetBox(scene.Box()).ok());
  ObjectView view = scene.View(0);
  view.object = ObjectId{8};
  EXPECT_EQ(field.AddView(view), absl::FailedPreconditionError("object/7: cannot add a view of object/8"));
  view = scene.View(0);
  view.ray_kind = cv::Mat::zeros(view.roi_px.size(), CV_8UC1);
  EXPECT_EQ(field.AddView(view).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(field.views(), 0);
}

TEST(ObjectFieldTest, RejectsInvalidBoxes) {
  const BallScene scene;
  ObjectField field(SmallFieldConfig(), scene.object, 1);
  EXPECT_EQ(field.AddView(scene.View(0)).code(), absl::StatusCode::kFailedPrecondition);
  Cuboid flat = scene.Box();
  flat.half_extents.z() = 0;
  EXPECT_THAT(Message(field.SetBox(flat)), HasSubstr("half extents must be positive"));
  EXPECT_EQ(field.Train(5, 1).steps, 0);
}

TEST(ObjectFieldTest, RestartsOnlyIfTheBoxesBarelyOverlap) {
  const BallScene scene;
  ObjectField field = MakeField(scene, SmallFieldConfig());
  field.Train(10, 1);
  Cuboid box = scene.Box();
  box.half_extents *= 0.95;
  box.T_world_object =
      box.T_world_object * SE3<Object, Object>(Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitZ())),
                                               Eigen::Vector3d(0.02, 0, 0));
  ASSERT_TRUE(field.SetBox(box).ok());
  EXPECT_EQ(field.steps(), 10u);
  EXPECT_NEAR(field.Snapshot().box_half_extents.x(), 1.1 * scene.radius_mu, 1e-5) << "the cuboid fits the old box";
  box.half_extents *= 1.5;
  ASSERT_TRUE(field.SetBox(box).ok());
  EXPECT_EQ(field.steps(), 10u);
  EXPECT_NEAR(field.Snapshot().box_half_extents.x(), 1.1 * box.half_extents.x(), 1e-5);
  box.half_extents *= 3;
  ASSERT_TRUE(field.SetBox(box).ok());
  EXPECT_EQ(field.steps(), 0u);
  EXPECT_EQ(field.views(), scene.views);
  field.Train(10, 1);
  EXPECT_EQ(field.steps(), 10u);
  EXPECT_NEAR(field.Snapshot().box_half_extents.x(), 1.1 * box.half_extents.x(), 1e-5);
}

TEST(ObjectFieldTest, AViewOfTheSameKeyframeReplacesTheOldOne) {
  const BallScene scene;
  NerfConfig config = SmallFieldConfig();
  ObjectField field(config, scene.object, 1), clean(config, scene.object, 1);
  ASSERT_TRUE(field.SetBox(scene.Box()).ok());
  ASSERT_TRUE(clean.SetBox(scene.Box()).ok());
  for (const ObjectView& view : scene.Views()) {
    ObjectView wrong = view;
    wrong.T_world_camera = {view.T_world_camera.rotation(), view.T_world_camera.translation() * 1.05};
    ASSERT_TRUE(field.AddView(wrong).ok());
    ASSERT_TRUE(clean.AddView(view).ok());
  }
  for (const ObjectView& view : scene.Views()) ASSERT_TRUE(field.AddView(view).ok());
  EXPECT_EQ(field.views(), scene.views);
  field.Train(1, 1);
  clean.Train(1, 1);
  EXPECT_EQ(field.Snapshot().hull.bits, clean.Snapshot().hull.bits);
  EXPECT_EQ(RawOnGrid(field.Snapshot()), RawOnGrid(clean.Snapshot()));
}

}  // namespace romap::nerf::object_field_test
