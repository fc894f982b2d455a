#include "server/mesh/confirmed_space.h"

#include <gtest/gtest.h>

#include <numbers>

#include "server/mesh/extract_mesh.h"
#include "server/mesh/sample_field.h"
#include "tests/unit/server/mesh/field_fakes.h"
#include "tests/unit/server/mesh/mesh_checks.h"

namespace romap::mesh {
namespace {

constexpr double kLeastShare = 0.25;

// Marks the pixels of a view whose rays from the camera meet `shape` (> 0 inside) within the box of half extents 1.
void Paint(TrainingCamera& view, const InsideDistance& shape, RayKind kind) {
  const SE3<Object, Camera> T_object_camera = view.T_camera_object.Inverse();
  for (int v = 0; v < view.ray_kind.rows; ++v) {
    for (int u = 0; u < view.ray_kind.cols; ++u) {
      const Eigen::Vector3d direction = T_object_camera.rotation() * view.camera.Unproject(u, v).normalized();
      float nearest = -1;  // signed distances let us go that far without missing anything
      for (double at = 2; at < 6 && nearest <= 0; at += std::max(0.004f, -nearest)) {
        nearest = shape((T_object_camera.translation() + at * direction).cast<float>());
      }
      if (nearest > 0) view.ray_kind.at<uint8_t>(v, u) = static_cast<uint8_t>(kind);
    }
  }
}

// Views all around that show `object`, before `behind` showing only what is in the way of it.
std::vector<TrainingCamera> ViewsOf(const InsideDistance& object, const InsideDistance& behind, int count = 12) {
  std::vector<TrainingCamera> views;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / count;
    views.push_back(ViewFrom({4 * std::cos(angle), 4 * std::sin(angle), 0.8}));
    views.back().ray_kind.setTo(static_cast<int>(RayKind::kBackground));
    Paint(views.back(), behind, RayKind::kOccluder);
    Paint(views.back(), object, RayKind::kObject);
  }
  return views;
}

const InsideDistance kBody = Sphere(0.35f, {-0.4f, 0, 0});
const InsideDistance kWall = [](const Eigen::Vector3f& p) {  // as large as the body, along a wall of the box
  return std::min({p.x() - 0.7f, 0.5f - std::abs(p.y()), 0.6f - std::abs(p.z())});
};

FieldSnapshot SeenSnapshot(const InsideDistance& field, std::vector<TrainingCamera> views) {
  FieldSnapshot snapshot = SnapshotOf(field);
  snapshot.cameras = std::move(views);
  return snapshot;
}

Mesh Extract(const FieldSnapshot& snapshot, double least_share) {
  MeshConfig config;
  config.min_confirmed_share = least_share;
  config.cut_below_support = false;
  absl::StatusOr<Mesh> mesh = ExtractMesh(snapshot, config);
  EXPECT_TRUE(mesh.ok()) << mesh.status();
  return mesh.ok() ? *std::move(mesh) : Mesh{};
}

float LargestX(const Mesh& mesh) {
  float largest = -1;
  for (const Eigen::Vector3f& p : mesh.vertices) largest = std::max(largest, p.x());
  return largest;
}

TEST(ConfirmedSpace, WhatOnlyHidesBehindNeighboursAlongAWallGoesHoweverLarge) {
  const FieldSnapshot snapshot = SeenSnapshot(Union({kBody, kWall}), ViewsOf(kBody, kWall));
  EXPECT_GT(LargestX(Extract(snapshot, 0)), 0.9f);  // else there is nothing to show here
  const Mesh mesh = Extract(snapshot, kLeastShare);
  EXPECT_LT(LargestX(mesh), 0.0f);
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  EXPECT_NEAR(Volume(mesh), 4.0 / 3.0 * std::numbers::pi * 0.0429, 0.005);
}

TEST(ConfirmedSpace, WhatHangsOnTheBodyGoesToo) {
  const InsideDistance bridge = Stem(-0.2f, 0.9f, 0.12f);
  const FieldSnapshot snapshot = SeenSnapshot(Union({kBody, kWall, bridge}), ViewsOf(kBody, Union({kWall, bridge})));
  EXPECT_LT(LargestX(Extract(snapshot, kLeastShare)), 0.55f);
}

// A stem of 1.5 cells, all of whose surroundings are other objects in every view, and the bud at its end.
TEST(ConfirmedSpace, ThinTruePartsAmongNeighboursStay) {
  const InsideDistance flower = Union({kBody, Stem(-0.4f, 0.8f, 0.024f), Sphere(0.1f, {0.8f, 0, 0})});
  const InsideDistance everywhere = [](const Eigen::Vector3f& p) { return 0.99f - p.cwiseAbs().maxCoeff(); };
  const FieldSnapshot snapshot = SeenSnapshot(flower, ViewsOf(flower, everywhere));
  const Mesh with = Extract(snapshot, kLeastShare), without = Extract(snapshot, 0);
  EXPECT_NEAR(LargestX(with), 0.9f, 0.01f);
  EXPECT_EQ(CheckTopology(with).components, 1u);
  EXPECT_NEAR(Area(with), Area(without), 0.02 * Area(without));
}

TEST(ConfirmedSpace, HalfOfTheViewsAreEnough) {
  std::vector<TrainingCamera> views = ViewsOf(kBody, kWall);
  for (size_t i = 0; i < views.size(); ++i) {
    if (i % 2 != 0) views[i].ray_kind.setTo(static_cast<int>(RayKind::kOccluder));  // something stands before all
  }
  const FieldSnapshot snapshot = SeenSnapshot(kBody, views);
  const double whole = Volume(Extract(snapshot, 0));
  EXPECT_NEAR(Volume(Extract(snapshot, kLeastShare)), whole, 0.02 * whole);
}

TEST(ConfirmedSpace, OutsideTheCropIsNoConfirmationButOutsideTheImageSaysNothing) {
  FieldSnapshot snapshot = SnapshotOf(Union({kBody, kWall}));
  const SurfaceProbe probe(snapshot);
  const FieldGrid before = SampleField(snapshot, probe, {48, 48, 48}).grid;
  const auto matter_at_wall = [&](const std::vector<TrainingCamera>& views) {
    FieldGrid grid = before;
    EmptyUnconfirmed(views, kLeastShare, grid);
    size_t nodes = 0;
    for (size_t node = 0; node < grid.value.size(); ++node) {
      nodes += grid.value[node] > 0 && grid.Position(grid.NodeAt(node)).x() > 0.75f;
    }
    return nodes;
  };
  // From y = -4 with x to the right: the wall is right of pixel 240.
  TrainingCamera view = ViewFrom({0, -4, 0});
  ASSERT_GT(view.camera.Project(view.T_camera_object * Eigen::Vector3d(0.75, 0.5, 0)).x(), 240);
  EXPECT_GT(matter_at_wall({view}), 1000u);
  view.roi_px.width = 240;
  view.ray_kind = view.ray_kind.colRange(0, 240).clone();
  EXPECT_EQ(matter_at_wall({view}), 0u);
  view.camera.width_px = 240;
  EXPECT_GT(matter_at_wall({view}), 1000u);
  EXPECT_GT(matter_at_wall({}), 1000u);
}

// Grids of all sizes are looked at up to their last nodes, and views that cannot be are not counted.
TEST(ConfirmedSpace, LooksAtEveryNode) {
  TrainingCamera view = ViewFrom({0, -4, 0});
  view.ray_kind.setTo(static_cast<int>(RayKind::kOccluder));
  const TrainingCamera nowhere = ViewFrom({std::numeric_limits<double>::quiet_NaN(), 0, 0});
  for (int nodes = 2; nodes < 16; ++nodes) {
    FieldGrid grid = MakeEmptyGrid({nodes, nodes + 1, nodes + 2}, Eigen::Vector3f::Constant(0.5f));
    for (float& value : grid.value) value = value == kBeyondBox ? kBeyondBox : 1;
    const std::vector<TrainingCamera> views = {view, nowhere, nowhere};
    EmptyUnconfirmed(views, kLeastShare, grid);
    EXPECT_EQ(std::count_if(grid.value.begin(), grid.value.end(), [](float value) { return value > 0; }), 0) << nodes;
  }
}

}  // namespace
}  // namespace romap::mesh
