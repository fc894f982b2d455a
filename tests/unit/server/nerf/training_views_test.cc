#include "server/nerf/training_views.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::training_views_test {

using testing_support::BallScene;

struct TrainingViewsTest : public ::testing::Test {
  TrainingViewsTest() {
    scene.views = 8;
    scene.size_px = 32;
    views.RebuildHull(box);
  }
  void AddAll() {
    for (const ObjectView& view : scene.Views()) ASSERT_TRUE(views.Add(view, 0).ok());
  }
  // The view of `index`, shifted along the x axis of its camera.
  ViewPose Shifted(int index, double shift_mu) const {
    const ObjectView view = scene.View(index);
    const SE3<Camera, Camera> shift(Eigen::Quaterniond::Identity(), Eigen::Vector3d(shift_mu, 0, 0));
    return {view.keyframe, view.T_world_camera * shift};
  }
  // Residuals that exceed every limit in the view of `outlier`.
  ProbeReport ReportWithOutlier(size_t outlier) const {
    ProbeReport report{std::vector<ViewResidual>(views.size(), {0.02f, 0.05f, 0.01f})};
    report.views[outlier] = {0.8f, 0.8f, 0.0f};
    return report;
  }
  static std::ptrdiff_t Cells(const std::vector<uint8_t>& hull) { return std::ranges::count(hull, 1); }

  BallScene scene;
  NerfConfig config;
  TrainingBox box = TrainingBox::Around(scene.Box(), 0.1);
  TrainingViews views{config};
};

TEST_F(TrainingViewsTest, AViewOfTheSameKeyframeReplacesTheOldOneAndItsVote) {
  AddAll();
  const std::vector<uint8_t> hull = views.CarveHull();
  ObjectView empty = scene.View(3);
  empty.ray_kind = cv::Mat(empty.roi_px.size(), CV_8UC1, cv::Scalar(static_cast<int>(RayKind::kBackground)));
  ASSERT_TRUE(views.Add(empty, 0).ok());
  EXPECT_EQ(views.size(), 8u);
  EXPECT_LT(Cells(views.CarveHull()), Cells(hull));
  ASSERT_TRUE(views.Add(scene.View(3), 0).ok());
  EXPECT_EQ(views.CarveHull(), hull);
}

TEST_F(TrainingViewsTest, UntrustedViewsDoNotVote) {
  AddAll();
  const std::vector<uint8_t> hull = views.CarveHull();
  EXPECT_TRUE(views.UpdateTrust(ReportWithOutlier(2), 100));
  EXPECT_FALSE(views.trusted(2));
  EXPECT_EQ(views.Weights()[2], 0);
  views.RebuildHull(box);
  EXPECT_GT(Cells(views.CarveHull()), Cells(hull));
  views.ResetTrust();
  views.RebuildHull(box);
  EXPECT_EQ(views.CarveHull(), hull);
}

TEST_F(TrainingViewsTest, OnlyALargeCorrectionRestoresTrust) {
  AddAll();
  ASSERT_TRUE(views.UpdateTrust(ReportWithOutlier(2), 100));
  const double side_mu = box.LongestSide_mu();
  const auto small = views.Correct(Shifted(2, 0.005 * side_mu), box, 100);
  ASSERT_TRUE(small.ok());
  EXPECT_NEAR(small->value(), 0.005, 1e-6);
  EXPECT_FALSE(views.trusted(2));
  const auto large = views.Correct(Shifted(2, 0.05 * side_mu), box, 100);
  ASSERT_TRUE(large.ok());
  EXPECT_NEAR(large->value(), 0.045, 1e-6);
  EXPECT_TRUE(views.trusted(2));
}

TEST_F(TrainingViewsTest, CorrectionsOfUnknownViewsAreIgnored) {
  AddAll();
  const auto shift = views.Correct({KeyframeId{999}, SE3<World, Camera>()}, box, 0);
  ASSERT_TRUE(shift.ok());
  EXPECT_FALSE(shift->has_value());
}

TEST_F(TrainingViewsTest, RejectsMoreViewsThanTheHullCanCount) {
  ObjectView view = scene.View(0);
  for (uint64_t keyframe = 1; keyframe <= TrainingViews::kMaxViews; ++keyframe) {
    view.keyframe = KeyframeId{keyframe};
    ASSERT_TRUE(views.Add(view, 0).ok());
  }
  EXPECT_TRUE(views.Add(view, 0).ok()) << "replaces the last view";
  view.keyframe = KeyframeId{TrainingViews::kMaxViews + 1};
  EXPECT_EQ(views.Add(view, 0).code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(views.size(), TrainingViews::kMaxViews);
}

}  // namespace romap::nerf::training_views_test
