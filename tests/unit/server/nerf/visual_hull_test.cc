#include "server/nerf/visual_hull.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <opencv2/core.hpp>

#include "common/geometry.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::visual_hull_test {

using testing_support::BallScene;

constexpr int kSide = kOccupancyResolution;

// Distance of a cell from the center of a BallScene's box with 10 % margin, in radii of the ball.
double DistanceInRadii(size_t cell) {
  const Eigen::Vector3d index(static_cast<double>(cell % kSide), static_cast<double>(cell / kSide % kSide),
                              static_cast<double>(cell / kSide / kSide));
  return 1.1 * ((index.array() + 0.5) / (kSide / 2) - 1.0).matrix().norm();
}

VisualHull HullOf(const BallScene& scene, const std::vector<ObjectView>& views, const NerfConfig& config = {}) {
  VisualHull hull(config);
  hull.Reset(TrainingBox::Around(scene.Box(), 0.1));
  for (const ObjectView& view : views) hull.Add(view);
  return hull;
}

TEST(VisualHullTest, ContainsTheBallAndLittleMore) {
  const BallScene scene;
  const std::vector<uint8_t> cells = HullOf(scene, scene.Views()).Carve();
  double inside = 0, kept = 0;
  for (size_t i = 0; i < cells.size(); ++i) {
    if (DistanceInRadii(i) < 1) ++inside;
    if (cells[i] != 0) ++kept;
    EXPECT_TRUE(DistanceInRadii(i) > 0.98 || cells[i] == 1) << "cell " << i;
  }
  EXPECT_LT(kept, 1.35 * inside);
}

TEST(VisualHullTest, OneWrongMaskRemovesNothingIfTwoViewsMustAgree) {
  const BallScene scene;
  NerfConfig config;
  config.hull_min_votes = 2;
  VisualHull hull = HullOf(scene, scene.Views(), config);
  const std::vector<uint8_t> before = hull.Carve();
  ObjectView wrong = scene.View(3);
  hull.Remove(wrong);
  wrong.ray_kind = wrong.ray_kind.clone();
  wrong.ray_kind.colRange(0, scene.size_px / 2).setTo(static_cast<int>(RayKind::kBackground));
  hull.Add(wrong);
  const std::vector<uint8_t> after = hull.Carve();
  for (size_t i = 0; i < after.size(); ++i) {
    if (DistanceInRadii(i) < 0.95 && before[i] != 0) {
      EXPECT_EQ(after[i], 1) << "cell " << i;
    }
  }
}

TEST(VisualHullTest, OccludersRemoveNothingFromTheBall) {
  const BallScene scene;
  std::vector<ObjectView> views = scene.Views();
  for (int i = 0; i < 3; ++i) {
    views.push_back(scene.View(i));
    views.back().ray_kind = cv::Mat(views.back().roi_px.size(), CV_8UC1);
    views.back().ray_kind.setTo(static_cast<int>(RayKind::kOccluder));
  }
  const std::vector<uint8_t> cells = HullOf(scene, views).Carve();
  for (size_t i = 0; i < cells.size(); ++i) EXPECT_TRUE(DistanceInRadii(i) > 0.98 || cells[i] == 1) << "cell " << i;
}

TEST(VisualHullTest, WithoutViewsAllCellsAreKept) {
  const BallScene scene;
  VisualHull hull = HullOf(scene, {});
  const auto all_kept = [&] {
    const std::vector<uint8_t> cells = hull.Carve();
    return std::ranges::count(cells, 1) == static_cast<std::ptrdiff_t>(cells.size());
  };
  EXPECT_TRUE(all_kept());
  hull.Add(scene.View(0));
  EXPECT_FALSE(all_kept());
  hull.Remove(scene.View(0));
  EXPECT_TRUE(all_kept());
}

// A dent that is invisible in every outline: the depth of all views is behind the ball's surface.
TEST(VisualHullTest, DepthCarvesConcavities) {
  BallScene scene;
  scene.with_depth = true;
  const TrainingBox box = TrainingBox::Around(scene.Box(), 0.1);
  const Eigen::Vector3d eye = box.T_world_object.Inverse() * scene.View(0).T_world_camera.translation();
  const Eigen::Vector3d point = 0.9 * scene.radius_mu * eye.normalized();  // in the Object frame
  const auto is_kept = [&](double dent_mu, bool use_depth) {
    VisualHull hull(NerfConfig{});
    hull.Reset(box, {.depth_is_consistent = use_depth});
    for (ObjectView view : scene.Views()) {
      cv::add(view.depth_mu, dent_mu, view.depth_mu, view.depth_mu > 0);
      hull.Add(view);
    }
    return hull.Carve()[*hull::VoxelGrid{box.half_extents, kSide}.CellAt(point)] != 0;
  };
  EXPECT_TRUE(is_kept(0, true));
  EXPECT_FALSE(is_kept(0.5 * scene.radius_mu, true));
  EXPECT_TRUE(is_kept(0.5 * scene.radius_mu, false));
}

// ------------------------------------------------------------------------------------------- unconfirmed space

// Signed distance to a surface at a point of the box |p| <= 1, positive inside.
using InsideDistance = std::function<double(const Eigen::Vector3d&)>;

const TrainingBox kBox = TrainingBox::Around({.T_world_object = {}, .half_extents = {1, 1, 1}}, 0);
const Eigen::Vector3d kBodyCenter(-0.4, 0, 0);
const Eigen::Vector3d kWallCenter(0.9, 0, 0);

double Body(const Eigen::Vector3d& p) { return 0.35 - (p - kBodyCenter).norm(); }
// A slab along a side of the box, as large as the body.
double Wall(const Eigen::Vector3d& p) { return std::min({p.x() - 0.7, 0.5 - std::abs(p.y()), 0.6 - std::abs(p.z())}); }

ObjectView ViewFrom(const Eigen::Vector3d& center, RayKind kind) {
  ObjectView view;
  const Eigen::Quaterniond turn = ShortestRotation(-center, Eigen::Vector3d::UnitZ());
  view.T_world_camera = SE3<World, Camera>(turn.conjugate(), center);
  view.camera = {.width_px = 200, .height_px = 200, .fx_px = 200, .fy_px = 200, .cx_px = 99.5, .cy_px = 99.5};
  view.roi_px = {0, 0, 200, 200};
  view.ray_kind = cv::Mat(200, 200, CV_8UC1, cv::Scalar(static_cast<int>(kind)));
  return view;
}

// Marks the pixels whose rays intersect a shape.
void Paint(ObjectView& view, const InsideDistance& shape, RayKind kind) {
  for (int v = 0; v < view.ray_kind.rows; ++v) {
    for (int u = 0; u < view.ray_kind.cols; ++u) {
      const Eigen::Vector3d ray = view.T_world_camera.rotation() * view.camera.Unproject(u, v).normalized();
      double distance = -1;
      for (double at = 2; at < 6 && distance <= 0; at += std::max(0.004, -distance)) {
        distance = shape(view.T_world_camera.translation() + at * ray);
      }
      if (distance > 0) view.ray_kind.at<uint8_t>(v, u) = static_cast<uint8_t>(kind);
    }
  }
}

// Views from all around in which other objects hide `hidden`, and `object` is in front of them.
std::vector<ObjectView> ViewsOf(const InsideDistance& object, const InsideDistance& hidden) {
  constexpr int kViews = 12;
  std::vector<ObjectView> views;
  for (int i = 0; i < kViews; ++i) {
    const double angle = 2 * std::numbers::pi * i / kViews;
    views.push_back(ViewFrom({4 * std::cos(angle), 4 * std::sin(angle), 0.8}, RayKind::kBackground));
    Paint(views.back(), hidden, RayKind::kOccluder);
    Paint(views.back(), object, RayKind::kObject);
  }
  return views;
}

bool IsKept(const std::vector<ObjectView>& views, const Eigen::Vector3d& point, const NerfConfig& config = {}) {
  VisualHull hull(config);
  hull.Reset(kBox);
  for (const ObjectView& view : views) hull.Add(view);
  return hull.Carve()[*hull::VoxelGrid{kBox.half_extents, kSide}.CellAt(point)] != 0;
}

TEST(UnconfirmedSpaceTest, SpaceBehindOtherObjectsIsRemoved) {
  const std::vector<ObjectView> views = ViewsOf(Body, Wall);
  NerfConfig without_rule;
  without_rule.hull_show_share = 0;
  EXPECT_TRUE(IsKept(views, kWallCenter, without_rule)) << "no view shows background there";
  EXPECT_FALSE(IsKept(views, kWallCenter));
  EXPECT_TRUE(IsKept(views, kBodyCenter));
}

// A stem of one cell, and the bud at its end, among other objects in every view.
TEST(UnconfirmedSpaceTest, ThinPartsAmongOtherObjectsAreKept) {
  const InsideDistance flower = [](const Eigen::Vector3d& p) {
    const Eigen::Vector3d on_stem(std::clamp(p.x(), -0.4, 0.8), 0, 0);
    return std::max({Body(p), 0.016 - (p - on_stem).norm(), 0.1 - (p - Eigen::Vector3d(0.8, 0, 0)).norm()});
  };
  const InsideDistance everywhere = [](const Eigen::Vector3d& p) { return 0.99 - p.cwiseAbs().maxCoeff(); };
  const std::vector<ObjectView> views = ViewsOf(flower, everywhere);
  for (double x = -0.4; x < 0.9; x += 0.1) EXPECT_TRUE(IsKept(views, {x, 0, 0})) << "x " << x;
  EXPECT_FALSE(IsKept(views, {0.3, 0.5, 0}));
}

TEST(UnconfirmedSpaceTest, HalfOfTheViewsConfirm) {
  std::vector<ObjectView> views = ViewsOf(Body, Wall);
  for (size_t i = 1; i < views.size(); i += 2) views[i].ray_kind.setTo(static_cast<int>(RayKind::kOccluder));
  for (const Eigen::Vector3d& offset : {Eigen::Vector3d(0, 0, 0), {0.3, 0, 0}, {0, -0.3, 0}, {0, 0, 0.3}}) {
    EXPECT_TRUE(IsKept(views, kBodyCenter + offset)) << offset.transpose();
  }
}

TEST(UnconfirmedSpaceTest, OutsideTheCropIsNoConfirmationButOutsideTheImageIsNoEvidence) {
  // Seen from y = -4 with x to the right, the wall projects to the right of column 120.
  const ObjectView whole = ViewFrom({0, -4, 0}, RayKind::kObject);
  ASSERT_GT(whole.camera.Project(whole.T_world_camera.Inverse() * Eigen::Vector3d(0.75, 0.5, 0)).x(), 120);
  ObjectView cropped = whole;
  cropped.roi_px.width = 120;
  cropped.ray_kind = cropped.ray_kind.colRange(0, 120).clone();
  ObjectView narrow = cropped;
  narrow.camera.width_px = 120;
  EXPECT_TRUE(IsKept({whole}, kWallCenter));
  EXPECT_FALSE(IsKept({whole, cropped, cropped, cropped, cropped}, kWallCenter));
  EXPECT_TRUE(IsKept({whole, narrow, narrow, narrow, narrow}, kWallCenter));
}

}  // namespace romap::nerf::visual_hull_test
