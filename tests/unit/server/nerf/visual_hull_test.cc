#include "server/nerf/visual_hull.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <vector>

#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf {
namespace {

using testing::BallScene;

// Distance of the center of a hull cell from the center of the ball, in radii; the box is 10 % larger than the ball.
double RadiiFromCenter(size_t cell) {
  const Eigen::Vector3d index(static_cast<double>(cell % 64), static_cast<double>(cell / 64 % 64),
                              static_cast<double>(cell / 4096));
  return 1.1 * ((index.array() + 0.5) / 32.0 - 1.0).matrix().norm();
}

TEST(VisualHullTest, ContainsTheBallAndLittleMore) {
  const BallScene scene;
  VisualHull hull(NerfConfig{});
  hull.Reset(TrainingBox::Around(scene.Box(), 0.1));
  for (const ObjectView& view : scene.Views()) hull.Add(view);
  const std::vector<uint8_t> cells = hull.Carve();
  double inside = 0, kept = 0;
  for (size_t i = 0; i < cells.size(); ++i) {
    const double distance = RadiiFromCenter(i);
    if (distance < 1) ++inside;
    if (cells[i] != 0) ++kept;
    EXPECT_TRUE(distance > 0.98 || cells[i] == 1) << "cell " << i;
  }
  EXPECT_LT(kept, 1.35 * inside);
}

TEST(VisualHullTest, ToleratesOneWrongMask) {
  const BallScene scene;
  NerfConfig config;
  config.hull_min_votes = 2;
  VisualHull hull(config);
  hull.Reset(TrainingBox::Around(scene.Box(), 0.1));
  for (const ObjectView& view : scene.Views()) hull.Add(view);
  const std::vector<uint8_t> before = hull.Carve();
  ObjectView wrong = scene.View(3);
  hull.Remove(wrong);
  wrong.ray_kind = wrong.ray_kind.clone();
  wrong.ray_kind.colRange(0, scene.size_px / 2).setTo(static_cast<int>(RayKind::kBackground));
  hull.Add(wrong);
  const std::vector<uint8_t> after = hull.Carve();
  int lost_inside = 0;
  for (size_t i = 0; i < after.size(); ++i) {
    const double distance = RadiiFromCenter(i);
    lost_inside += distance < 0.95 && before[i] != 0 && after[i] == 0;
  }
  EXPECT_EQ(lost_inside, 0);
}

TEST(VisualHullTest, OccludersAndPixelsOutsideTheCropDoNotCarve) {
  const BallScene scene;
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
  // Additional views without evidence can only weaken the votes against a cell.
  const std::vector<uint8_t> after = hull.Carve();
  for (size_t i = 0; i < after.size(); ++i) EXPECT_GE(after[i], before[i]) << "cell " << i;
}

TEST(VisualHullTest, CellsThatAreOnlyOccludedAreCarved) {
  // In every view, an occluder covers the whole background.
  const BallScene scene;
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
  const std::vector<uint8_t> without_rule = carved(0), with_rule = carved(0.5);
  int inside = 0, outside = 0;
  for (size_t i = 0; i < with_rule.size(); ++i) {
    const double distance = RadiiFromCenter(i);
    EXPECT_EQ(without_rule[i], 1);
    if (distance < 0.98) {
      EXPECT_EQ(with_rule[i], 1) << "cell " << i;
      ++inside;
    } else if (distance > 1.7) {  // the corners; closer cells are in front of or behind the ball in many views
      EXPECT_EQ(with_rule[i], 0) << "cell " << i;
      ++outside;
    }
  }
  EXPECT_GT(inside, 0);
  EXPECT_GT(outside, 0);
}

TEST(VisualHullTest, WithoutViewsTheHullIsTheWholeBox) {
  const BallScene scene;
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

TEST(VisualHullTest, DepthCarvesDentsThatNoOutlineShows) {
  BallScene scene;
  scene.with_depth = true;
  const TrainingBox box = TrainingBox::Around(scene.Box(), 0.1);
  const Eigen::Vector3d eye = box.T_world_object.Inverse() * scene.View(0).T_world_camera.translation();
  const Eigen::Vector3d point = 0.9 * scene.radius_mu * eye.normalized();  // in the Object frame
  const auto kept = [&](double dent_mu, bool use_depth) {
    VisualHull hull(NerfConfig{});
    hull.Reset(box, use_depth);
    for (ObjectView view : scene.Views()) {
      cv::add(view.depth_mu, dent_mu, view.depth_mu, view.depth_mu > 0);
      hull.Add(view);
    }
    const Eigen::Vector3i cell = ((point.cwiseQuotient(box.half_extents).array() + 1) * 32).cast<int>();
    return hull.Carve()[static_cast<size_t>((cell.z() * 64 + cell.y()) * 64 + cell.x())] != 0;
  };
  EXPECT_TRUE(kept(0, true)) << "correct depth does not carve the ball";
  EXPECT_FALSE(kept(0.5 * scene.radius_mu, true));
  EXPECT_TRUE(kept(0.5 * scene.radius_mu, false));
}

}  // namespace
}  // namespace romap::nerf
