#include "server/mesh/solid_cut.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/mesh/extract_mesh.h"
#include "server/mesh/sample_field.h"
#include "tests/unit/server/mesh/field_fakes.h"
#include "tests/unit/server/mesh/mesh_checks.h"

namespace romap::mesh::solid_cut_test {

constexpr int kNodes = 64;

// A shell without the part that `opening` removes.
InsideDistance Shell(float radius, float thickness, InsideDistance opening) {
  return [=](const Eigen::Vector3f& p) {
    const float shell = 0.5f * thickness - std::abs(p.norm() - (radius - 0.5f * thickness));
    return std::min(shell, -opening(p));
  };
}

// A tube around the z axis, above the center.
InsideDistance Hole(float radius) {
  return [=](const Eigen::Vector3f& p) { return std::min(radius - p.head<2>().norm(), p.z()); };
}

class SolidCutTest : public ::testing::Test {
 protected:
  // Views from rings at several heights above the object.
  static FieldSnapshot WithViews(InsideDistance distance) {
    FieldSnapshot snapshot = SnapshotOf(std::move(distance));
    snapshot.converged = true;
    for (const double elevation : {0.3, 0.7, 1.2}) {
      for (int k = 0; k < 12; ++k) {
        const double azimuth = k * 2 * EIGEN_PI / 12;
        snapshot.cameras.push_back(ViewFrom({3 * std::cos(elevation) * std::cos(azimuth),
                                             3 * std::cos(elevation) * std::sin(azimuth), 3 * std::sin(elevation)}));
      }
    }
    return snapshot;
  }
  static FieldGrid Sample(const FieldSnapshot& snapshot) {
    return SampleField(snapshot, SurfaceProbe(snapshot), Eigen::Vector3i::Constant(kNodes)).grid;
  }
  static float ValueAt(const FieldGrid& grid, const Eigen::Vector3f& p) {
    const Eigen::Vector3i node = (grid.ToNode(p).array() + 0.5f).cast<int>();
    return grid.value[grid.Index(node.x(), node.y(), node.z())];
  }
};

TEST_F(SolidCutTest, ACavityBehindAPinholeBecomesSolid) {
  const FieldSnapshot snapshot = WithViews(Shell(0.7f, 0.12f, Hole(0.08f)));
  FieldGrid grid = Sample(snapshot);
  ASSERT_LT(ValueAt(grid, {0, 0, 0.1f}), 0) << "the pinhole must open the cavity";
  EXPECT_TRUE(CutSolid(grid, snapshot));
  for (const float z : {-0.4f, 0.0f, 0.4f}) EXPECT_GT(ValueAt(grid, {0, 0, z}), 0) << z;
  EXPECT_LT(ValueAt(grid, {0, 0, 0.9f}), 0) << "the space around the object stays empty";
}

TEST_F(SolidCutTest, TheInsideOfABowlStaysOpen) {
  const InsideDistance above = [](const Eigen::Vector3f& p) { return p.z() - 0.1f; };
  const FieldSnapshot snapshot = WithViews(Shell(0.7f, 0.12f, above));
  FieldGrid grid = Sample(snapshot);
  EXPECT_TRUE(CutSolid(grid, snapshot));
  for (const float z : {-0.4f, -0.2f, 0.0f}) EXPECT_LT(ValueAt(grid, {0, 0, z}), 0) << z;
}

TEST_F(SolidCutTest, ThinPartsAndTheirSurroundingsStay) {
  const FieldSnapshot snapshot = WithViews(Union({Sphere(0.3f, {-0.5f, 0, 0}), Stem(-0.5f, 0.8f, 0.05f)}));
  const FieldGrid before = Sample(snapshot);
  FieldGrid grid = before;
  EXPECT_TRUE(CutSolid(grid, snapshot));
  for (float x = -0.1f; x < 0.8f; x += 0.1f) {
    EXPECT_EQ(ValueAt(grid, {x, 0, 0}), ValueAt(before, {x, 0, 0}));
    EXPECT_LT(ValueAt(grid, {x, 0, 0.15f}), 0) << x;
  }
}

TEST_F(SolidCutTest, WithoutViewsTheGridIsUnchanged) {
  FieldSnapshot snapshot = WithViews(Sphere(0.5f));
  snapshot.cameras.clear();
  FieldGrid grid = Sample(snapshot);
  const std::vector<float> before = grid.value;
  EXPECT_FALSE(CutSolid(grid, snapshot));
  EXPECT_EQ(grid.value, before);
}

TEST_F(SolidCutTest, TheMeshOfAConvergedFieldIsSolid) {
  FieldSnapshot snapshot = WithViews(Shell(0.7f, 0.12f, Hole(0.12f)));
  MeshConfig config;
  config.cut_below_support = false;
  snapshot.converged = false;
  const auto hollow = ExtractMesh(snapshot, config);
  snapshot.converged = true;
  const auto solid = ExtractMesh(snapshot, config);
  ASSERT_TRUE(hollow.ok() && solid.ok());
  EXPECT_TRUE(CheckTopology(*solid).IsClosedManifold());
  // The inner wall of the shell is at 0.58, and the pinhole is closed above 0.5.
  const auto inner_vertices = [](const Mesh& mesh) {
    return std::count_if(mesh.vertices.begin(), mesh.vertices.end(), [](const auto& v) { return v.norm() < 0.5f; });
  };
  EXPECT_GT(inner_vertices(*hollow), 100) << "otherwise the test shows nothing";
  EXPECT_LT(inner_vertices(*solid), 0.05 * static_cast<double>(inner_vertices(*hollow)));
}

}  // namespace romap::mesh::solid_cut_test
