#include "server/objects/silhouette_hull.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

namespace romap::objects::silhouette_hull_test {

constexpr int kCells = 20;
constexpr uint16_t kObjectLabel = 1;
constexpr uint16_t kNeighborLabel = 2;
constexpr uint16_t kUnknownLabel = 3;

hull::CarvingRule Rule(int min_background, int min_object) {
  return {.min_background = min_background, .min_object = min_object};
}

HullRegion Region() {
  HullRegion region;
  region.R_world_grid = Eigen::AngleAxisd(0.3, Eigen::Vector3d(0.1, 0.2, 1).normalized()).toRotationMatrix();
  region.center_world = {0.2, -0.1, 0.4};
  region.half_extents = {0.3, 0.35, 0.25};
  return region;
}

// A random camera around the region whose masks are random ellipses: the object, a neighbor whose cuboid is known, and
// an object without a known cuboid. Some cameras are inside the region, so that part of it is behind them.
Silhouette RandomSilhouette(std::mt19937& random) {
  const auto draw = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  const Eigen::Vector3d center = Region().center_world;
  const double azimuth = draw(0, 6.28);
  const double distance = draw(0.1, 1.5);
  const Eigen::Vector3d eye = center + distance * Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), draw(0, 1));
  Eigen::Matrix3d R_world_camera;
  R_world_camera.col(2) = (center - eye).normalized();
  R_world_camera.col(0) = R_world_camera.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
  R_world_camera.col(1) = R_world_camera.col(2).cross(R_world_camera.col(0));

  auto frame = std::make_shared<Frame>();
  frame->camera = {.width_px = 640, .height_px = 480, .fx_px = 500, .fy_px = 500, .cx_px = 320, .cy_px = 240};
  frame->labels = cv::Mat::zeros(480, 640, CV_16UC1);
  for (const uint16_t label : {kObjectLabel, kNeighborLabel, kUnknownLabel}) {
    const cv::Point at(static_cast<int>(draw(100, 540)), static_cast<int>(draw(80, 400)));
    const cv::Size axes(static_cast<int>(draw(40, 150)), static_cast<int>(draw(40, 150)));
    cv::ellipse(frame->labels, at, axes, draw(0, 180), 0, 360, cv::Scalar(label), cv::FILLED);
  }
  std::vector<Detection> detections(3);
  for (uint16_t d = 0; d < 3; ++d) {
    detections[d].label = static_cast<uint16_t>(d + 1);
    detections[d].box_px = cv::boundingRect(frame->labels == d + 1);
  }
  KeyframeView view;
  view.frame = frame;
  view.T_world_camera = {R_world_camera, eye};
  Silhouette silhouette = MakeSilhouette(view, SubsampleMasks(frame->labels, detections, {1, 2, 3}), detections[0], 0);
  const Cuboid neighbor{.T_world_object = {Eigen::Matrix3d(Eigen::Matrix3d::Identity()),
                                           center + Eigen::Vector3d(draw(-0.3, 0.3), draw(-0.3, 0.3), 0)},
                        .half_extents = {0.1, 0.15, 0.2}};
  UpdateNeighbors({{2, neighbor}}, &silhouette);
  return silhouette;
}

enum class MaskHit { kUnknown /* outside the image or occluded */, kInside, kOutside };

// The part of a mask to which a point projects, in double precision.
MaskHit MaskAt(const Silhouette& silhouette, const Eigen::Vector3d& p_world) {
  const Eigen::Matrix<double, 3, 4>& P = silhouette.P_image_world;
  const int mask_index = silhouette.IndexAt(P.leftCols<3>() * p_world + P.col(3));
  if (mask_index == silhouette.index) return MaskHit::kInside;
  if (mask_index == 0) return MaskHit::kOutside;
  return mask_index < 0 || silhouette.MayOcclude(mask_index, p_world) ? MaskHit::kUnknown : MaskHit::kOutside;
}

// Counts the cells for which the hull differs from MaskAt() of every silhouette.
int CountDifferences(const SilhouetteHull& hull, const std::vector<Silhouette>& silhouettes,
                     const hull::CarvingRule& rule) {
  const HullRegion& region = hull.region();
  int differences = 0;
  for (int i = 0; i < kCells * kCells * kCells; ++i) {
    const Eigen::Array3d cell(i % kCells, i / kCells % kCells, i / (kCells * kCells));
    const Eigen::Vector3d p_grid = (2 * (cell + 0.5) / kCells - 1) * region.half_extents.array();
    int inside = 0;
    int outside = 0;
    for (const Silhouette& silhouette : silhouettes) {
      const MaskHit hit = MaskAt(silhouette, region.ToWorld(p_grid));
      inside += hit == MaskHit::kInside ? 1 : 0;
      outside += hit == MaskHit::kOutside ? 1 : 0;
    }
    const bool expected = outside < rule.min_background && inside >= rule.min_object;
    differences += hull.Contains(p_grid, rule) != expected ? 1 : 0;
  }
  return differences;
}

// Cells that project to the border between two pixels of a mask may differ.
constexpr int kMaxOnBorders = kCells * kCells * kCells / 1000;

TEST(SilhouetteHullTest, EqualsTheVotesOfEverySilhouetteAtEveryCell) {
  std::mt19937 random(7);
  for (int round = 0; round < 6; ++round) {
    SilhouetteHull hull;
    hull.Reset(Region(), kCells);
    std::vector<Silhouette> silhouettes;
    for (int i = 0; i < 5; ++i) {
      silhouettes.push_back(RandomSilhouette(random));
      hull.Add(silhouettes.back());
    }
    for (const hull::CarvingRule& rule : {Rule(1, 1), Rule(2, 2), Rule(3, 0)}) {
      EXPECT_LE(CountDifferences(hull, silhouettes, rule), kMaxOnBorders) << "round " << round;
    }
  }
}

TEST(SilhouetteHullTest, RemovingASilhouetteUndoesItsVotes) {
  std::mt19937 random(8);
  const Silhouette kept = RandomSilhouette(random);
  const Silhouette removed = RandomSilhouette(random);
  SilhouetteHull hull, without;
  hull.Reset(Region(), kCells);
  without.Reset(Region(), kCells);
  hull.Add(removed);
  hull.Add(kept);
  hull.Remove(removed);
  without.Add(kept);
  for (const hull::CarvingRule& rule : {Rule(1, 0), Rule(1, 1), Rule(2, 1)}) {
    EXPECT_EQ(hull.Cells(rule), without.Cells(rule));
  }
}

TEST(SilhouetteHullTest, BoundsSurroundTheCells) {
  std::mt19937 random(9);
  SilhouetteHull hull;
  hull.Reset(Region(), kCells);
  EXPECT_TRUE(hull.Bounds(Rule(1, 1)).isEmpty());
  hull.Add(RandomSilhouette(random));
  const hull::CarvingRule rule = Rule(1, 1);
  Eigen::AlignedBox3d expected;
  for (const Eigen::Vector3d& cell : hull.Cells(rule)) {
    expected.extend(cell - hull.CellSize() / 2);
    expected.extend(cell + hull.CellSize() / 2);
  }
  ASSERT_FALSE(expected.isEmpty());
  EXPECT_TRUE(hull.Bounds(rule).isApprox(expected, 1e-12));
}

}  // namespace romap::objects::silhouette_hull_test
