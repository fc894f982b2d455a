#include "server/nerf/object_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cmath>
#include <limits>
#include <opencv2/core.hpp>

#include "common/status.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf {
namespace {

using testing::BallScene;
using testing::BallSurfaceError;
using ::testing::HasSubstr;
using testing::RawOnGrid;
using testing::SmallFieldConfig;

ObjectField MakeField(const testing::BallScene& scene, const NerfConfig& config, uint64_t seed = 1) {
  ObjectField field(config, scene.object, seed);
  EXPECT_TRUE(field.SetBox(scene.Box()).ok());
  for (const ObjectView& view : scene.Views()) EXPECT_TRUE(field.AddView(view).ok());
  return field;
}

TEST(ObjectFieldTest, LearnsTheShapeAndColourOfABall) {
  const testing::BallScene scene;
  ObjectField field = MakeField(scene, NerfConfig{});
  field.Train(150, 1);
  const TrainStats stats = field.Train(50, 1);
  EXPECT_EQ(stats.steps, 50);
  EXPECT_LT(stats.color_loss, 0.05);
  const FieldSnapshot snapshot = field.Snapshot();
  EXPECT_EQ(snapshot.steps, 200u);
  EXPECT_EQ(snapshot.views, scene.views);
  EXPECT_LT(testing::BallSurfaceError(scene, snapshot), 0.04);
  // Every view's central pixel shows the surface point towards it.
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

TEST(ObjectFieldTest, LearnsWithThePapersSamplingAndLosses) {
  testing::BallScene scene;
  scene.with_depth = true;
  NerfConfig config;
  config.sampling = "uniform";
  config.max_samples_per_ray = 32;
  config.random_background = true;
  ObjectField field = MakeField(scene, config);
  field.Train(150, 1);
  EXPECT_LT(testing::BallSurfaceError(scene, field.Snapshot()), 0.08);
}

TEST(ObjectFieldTest, DoesNotDependOnTheScaleOfTheMap) {
  std::vector<std::vector<float>> raws;
  for (const double radius : {0.5, 0.5 * 128, 0.5 / 128}) {  // powers of two scale without rounding
    testing::BallScene scene;
    scene.radius_mu = radius;
    ObjectField field = MakeField(scene, testing::SmallFieldConfig());
    field.Train(15, 1);
    raws.push_back(testing::RawOnGrid(field.Snapshot()));
  }
  for (size_t i = 0; i < raws[0].size(); ++i) {
    EXPECT_NEAR(raws[0][i], raws[1][i], 0.02) << i;
    EXPECT_NEAR(raws[0][i], raws[2][i], 0.02) << i;
  }
}

TEST(ObjectFieldTest, IsDeterministicForSeedAndThreadCount) {
  testing::BallScene scene;
  scene.views = 5;
  for (const int threads : {1, 2}) {
    ObjectField a = MakeField(scene, testing::SmallFieldConfig()), b = MakeField(scene, testing::SmallFieldConfig());
    a.Train(12, threads);
    b.Train(5, threads);
    b.Train(7, threads);
    EXPECT_EQ(testing::RawOnGrid(a.Snapshot()), testing::RawOnGrid(b.Snapshot())) << threads << " threads";
  }
  ObjectField a = MakeField(scene, testing::SmallFieldConfig(), 1),
              b = MakeField(scene, testing::SmallFieldConfig(), 2);
  a.Train(3, 1);
  b.Train(3, 1);
  EXPECT_NE(testing::RawOnGrid(a.Snapshot()), testing::RawOnGrid(b.Snapshot()));
}

TEST(ObjectFieldTest, EveryInstructionSetLearnsTheSame) {
  testing::BallScene scene;
  scene.views = 5;
  std::vector<double> losses;
  for (int64_t left = hwy::SupportedTargets(); left != 0; left &= left - 1) {
    hwy::SetSupportedTargetsForTest(left & -left);
    losses.push_back(MakeField(scene, testing::SmallFieldConfig()).Train(25, 1).color_loss);
    hwy::SetSupportedTargetsForTest(0);
  }
  for (const double loss : losses) EXPECT_NEAR(loss, losses[0], 0.02 * losses[0]);
}

TEST(ObjectFieldTest, SnapshotDoesNotChangeWhenTrainingGoesOn) {
  testing::BallScene scene;
  scene.views = 4;
  ObjectField field = MakeField(scene, testing::SmallFieldConfig());
  field.Train(5, 1);
  const FieldSnapshot snapshot = field.Snapshot();
  const std::vector<float> before = testing::RawOnGrid(snapshot);
  field.Train(5, 1);
  EXPECT_EQ(testing::RawOnGrid(snapshot), before);
  EXPECT_NE(testing::RawOnGrid(field.Snapshot()), before);
}

TEST(ObjectFieldTest, OutsideTheBoxThereIsNothing) {
  const testing::BallScene scene;
  const ObjectField field = MakeField(scene, testing::SmallFieldConfig());
  const std::vector<Eigen::Vector3f> points = {{2, 0, 0}, {0, 0, 0}, {0, NAN, 0}};
  std::vector<float> raw(3);
  std::vector<Rgb8> rgb(3);
  field.Snapshot().field->Sample(points, raw, rgb);
  EXPECT_EQ(raw[0], -1e4f);
  EXPECT_GT(raw[1], -100.0f);
  EXPECT_EQ(raw[2], -1e4f);
}

TEST(ObjectFieldTest, RejectsViewsThatCannotBe) {
  const testing::BallScene scene;
  const auto fault = [&](auto&& spoil) {
    ObjectField field(testing::SmallFieldConfig(), scene.object, 1);
    EXPECT_TRUE(field.SetBox(scene.Box()).ok());
    ObjectView view = scene.View(0);
    spoil(view);
    const absl::Status status = field.AddView(view);
    EXPECT_FALSE(status.ok());
    EXPECT_EQ(field.views(), 0);
    return std::string(status.message());
  };
  const Eigen::Vector3d nan = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(fault([&](ObjectView& v) {
                v.T_world_camera = {Eigen::Quaterniond::Identity(), nan};
              }),
              HasSubstr("pose is not finite"));
  EXPECT_THAT(fault([](ObjectView& v) { v.ray_kind = cv::Mat::zeros(v.roi_px.size(), CV_8UC1); }),
              HasSubstr("mask is empty"));
  EXPECT_THAT(fault([](ObjectView& v) { v.color_bgr = cv::Mat::zeros(10, 12, CV_8UC3); }),
              HasSubstr("color_bgr is 12x10 px, the crop is 72x72 px"));
  EXPECT_THAT(fault([](ObjectView& v) { v.depth_mu = cv::Mat::zeros(v.roi_px.size(), CV_16UC1); }),
              HasSubstr("depth_mu must be CV_32FC1"));
  EXPECT_THAT(fault([](ObjectView& v) { v.roi_px.x = 5; }), HasSubstr("does not lie in the image"));
  EXPECT_THAT(fault([](ObjectView& v) { v.camera.fx_px = 0; }), HasSubstr("object/7"));
  EXPECT_THAT(fault([](ObjectView& v) { v.camera.distortion[0] = 0.1; }), HasSubstr("distortion"));
  EXPECT_THAT(fault([](ObjectView& v) { v.keyframe = {}; }), HasSubstr("no keyframe id"));
  EXPECT_THAT(fault([](ObjectView& v) { v.object = ObjectId{8}; }), HasSubstr("object/8"));
  EXPECT_THAT(fault([](ObjectView& v) {
                const Eigen::AngleAxisd turn(M_PI, Eigen::Vector3d::UnitY());
                v.T_world_camera = {Eigen::Quaterniond(v.T_world_camera.RotationMatrix() * turn.toRotationMatrix()),
                                    v.T_world_camera.translation()};
              }),
              HasSubstr("behind the camera"));
}

TEST(ObjectFieldTest, NeedsABoxThatCanBe) {
  const testing::BallScene scene;
  ObjectField field(testing::SmallFieldConfig(), scene.object, 1);
  EXPECT_EQ(field.AddView(scene.View(0)).code(), absl::StatusCode::kFailedPrecondition);
  Cuboid flat = scene.Box();
  flat.half_extents.z() = 0;
  EXPECT_THAT(Message(field.SetBox(flat)), HasSubstr("half extents must be positive"));
  EXPECT_EQ(field.Train(5, 1).steps, 0);
}

TEST(ObjectFieldTest, OnlyABoxWithLittleInCommonStartsAnew) {
  const testing::BallScene scene;
  ObjectField field = MakeField(scene, testing::SmallFieldConfig());
  field.Train(10, 1);
  Cuboid box = scene.Box();
  box.half_extents *= 0.95;
  box.T_world_object =
      box.T_world_object * SE3<Object, Object>(Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitZ())),
                                               Eigen::Vector3d(0.02, 0, 0));
  ASSERT_TRUE(field.SetBox(box).ok());
  EXPECT_EQ(field.steps(), 10u);
  EXPECT_NEAR(field.Snapshot().box_half_extents.x(), 1.1 * scene.radius_mu, 1e-5) << "it fits as it is";
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

TEST(ObjectFieldTest, CorrectedPoseReplacesTheView) {
  const testing::BallScene scene;
  NerfConfig config = testing::SmallFieldConfig();
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
  EXPECT_EQ(testing::RawOnGrid(field.Snapshot()), testing::RawOnGrid(clean.Snapshot()));
}

TEST(ObjectFieldTest, ViewBeyondTheLimitReplacesTheNearestOne) {
  testing::BallScene scene;
  NerfConfig config = testing::SmallFieldConfig();
  config.max_views = 6;
  const ObjectField field = MakeField(scene, config);
  EXPECT_EQ(field.views(), 6);
}

TEST(VisualHullTest, HoldsTheBallAndLittleMore) {
  const testing::BallScene scene;
  VisualHull hull(NerfConfig{});
  hull.Reset(TrainingBox::Around(scene.Box(), 0.1));
  for (const ObjectView& view : scene.Views()) hull.Add(view);
  const std::vector<uint8_t> cells = hull.Carve();
  double inside = 0, kept = 0;
  for (size_t i = 0; i < cells.size(); ++i) {
    const Eigen::Vector3d cell(static_cast<double>(i % 64), static_cast<double>(i / 64 % 64),
                               static_cast<double>(i / 4096));
    const double distance = 1.1 * ((cell.array() + 0.5) / 32.0 - 1.0).matrix().norm();
    if (distance < 1) ++inside;
    if (cells[i] != 0) ++kept;
    EXPECT_TRUE(distance > 0.98 || cells[i] == 1) << "cell " << i;
  }
  EXPECT_LT(kept, 1.35 * inside);
}

TEST(VisualHullTest, OneBadMaskIsOutvoted) {
  const testing::BallScene scene;
  NerfConfig config;
  config.hull_min_votes = 2;
  VisualHull hull(config);
  hull.Reset(TrainingBox::Around(scene.Box(), 0.1));
  for (const ObjectView& view : scene.Views()) hull.Add(view);
  const std::vector<uint8_t> before = hull.Carve();
  ObjectView bad = scene.View(3);
  hull.Remove(bad);
  bad.ray_kind = bad.ray_kind.clone();
  bad.ray_kind.colRange(0, scene.size_px / 2).setTo(static_cast<int>(RayKind::kBackground));
  hull.Add(bad);
  const std::vector<uint8_t> after = hull.Carve();
  int lost_inside = 0;
  for (size_t i = 0; i < after.size(); ++i) {
    const Eigen::Vector3d cell(static_cast<double>(i % 64), static_cast<double>(i / 64 % 64),
                               static_cast<double>(i / 4096));
    const double distance = 1.1 * ((cell.array() + 0.5) / 32.0 - 1.0).matrix().norm();
    lost_inside += distance < 0.95 && before[i] != 0 && after[i] == 0;
  }
  EXPECT_EQ(lost_inside, 0);
}

TEST(VisualHullTest, OccludersAndPixelsOutsideTheCropCarveNothing) {
  const testing::BallScene scene;
  VisualHull hull(NerfConfig{});
  hull.Reset(TrainingBox::Around(scene.Box(), 0.1));
  for (const ObjectView& view : scene.Views()) hull.Add(view);
  const std::vector<uint8_t> before = hull.Carve();
  for (int i = 0; i < 3; ++i) {
    ObjectView view = scene.View(i);
    view.ray_kind = cv::Mat(view.roi_px.size(), CV_8UC1, cv::Scalar(static_cast<int>(RayKind::kOccluder)));
    hull.Add(view);
  }
  ObjectView view = scene.View(1);
  view.roi_px = {0, 0, 2, 2};  // smaller than any cell's footprint
  view.ray_kind = view.ray_kind(view.roi_px).clone();
  hull.Add(view);
  // The votes against a cell count for less among more views, never for more.
  const std::vector<uint8_t> after = hull.Carve();
  for (size_t i = 0; i < after.size(); ++i) EXPECT_GE(after[i], before[i]) << "cell " << i;
}

TEST(VisualHullTest, WhatOnlyHidesBehindOtherThingsIsNotTheObject) {
  // In every view something stands before all that is not the ball.
  const testing::BallScene scene;
  NerfConfig config;
  const auto carved = [&](double show_share) {
    config.hull_show_share = show_share;
    VisualHull hull(config);
    hull.Reset(TrainingBox::Around(scene.Box(), 0.1));
    for (ObjectView view : scene.Views()) {
      view.ray_kind.setTo(static_cast<int>(RayKind::kOccluder),
                          view.ray_kind == static_cast<int>(RayKind::kBackground));
      hull.Add(view);
    }
    return hull.Carve();
  };
  const std::vector<uint8_t> unasked = carved(0), asked = carved(0.5);
  int inside = 0, outside = 0;
  for (size_t i = 0; i < asked.size(); ++i) {
    const Eigen::Vector3d cell(static_cast<double>(i % 64), static_cast<double>(i / 64 % 64),
                               static_cast<double>(i / 4096));
    const double distance = 1.1 * ((cell.array() + 0.5) / 32.0 - 1.0).matrix().norm();
    EXPECT_EQ(unasked[i], 1);
    if (distance < 0.98) {
      EXPECT_EQ(asked[i], 1) << "cell " << i;
      ++inside;
    } else if (distance > 1.7) {  // the corners; nearer cells lie before or behind the ball in many views
      EXPECT_EQ(asked[i], 0) << "cell " << i;
      ++outside;
    }
  }
  EXPECT_GT(inside, 0);
  EXPECT_GT(outside, 0);
}

TEST(VisualHullTest, WithoutViewsAllIsPossible) {
  const testing::BallScene scene;
  VisualHull hull(NerfConfig{});
  hull.Reset(TrainingBox::Around(scene.Box(), 0.1));
  const auto all = [&] {
    const std::vector<uint8_t> cells = hull.Carve();
    return std::ranges::count(cells, 1) == static_cast<std::ptrdiff_t>(cells.size());
  };
  EXPECT_TRUE(all());
  hull.Add(scene.View(0));
  EXPECT_FALSE(all());
  hull.Remove(scene.View(0));
  EXPECT_TRUE(all());
}

}  // namespace
}  // namespace romap::nerf
