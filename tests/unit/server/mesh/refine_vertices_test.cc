#include "server/mesh/refine_vertices.h"

#include <gtest/gtest.h>

#include "server/mesh/sample_field.h"
#include "tests/unit/server/mesh/field_fakes.h"
#include "tests/unit/server/mesh/mesh_checks.h"

namespace romap::mesh::refine_vertices_test {

double LargestVertexDistance(const Mesh& mesh, const InsideDistance& distance) {
  double largest = 0;
  for (const Eigen::Vector3f& p : mesh.vertices) largest = std::max<double>(largest, std::abs(distance(p)));
  return largest;
}

// Steep outside and flat inside, like a trained density.
FieldSnapshot UnevenBall() {
  return SnapshotOf([](const Eigen::Vector3f& p) {
    const float distance = Sphere(0.6f)(p);
    return distance > 0 ? 0.5f * distance : distance - 20 * distance * distance;
  });
}

TEST(RefineVertices, FindsTheCrossingOfAnUnevenField) {
  const FieldSnapshot snapshot = UnevenBall();
  const SurfaceProbe probe(snapshot);
  const FieldGrid grid = SampleField(snapshot, probe, {24, 24, 24}).grid;
  GridSurface surface = MarchingCubes(grid);
  const double before = LargestVertexDistance(surface.mesh, Sphere(0.6f));
  RefineVertices(grid, probe, surface);
  const double after = LargestVertexDistance(surface.mesh, Sphere(0.6f));
  EXPECT_GT(before, 0.1 * grid.spacing.x());  // the error to be reduced
  EXPECT_LT(after, before / 3);
  EXPECT_TRUE(CheckTopology(surface.mesh).IsClosedManifold());
}

TEST(RefineVertices, KeepsVerticesAtEditedNodes) {
  const FieldSnapshot snapshot = UnevenBall();
  const SurfaceProbe probe(snapshot);
  FieldGrid grid = SampleField(snapshot, probe, {24, 24, 24}).grid;
  std::fill(grid.edited.begin(), grid.edited.end(), 1);
  GridSurface surface = MarchingCubes(grid);
  const std::vector<Eigen::Vector3f> before = surface.mesh.vertices;
  RefineVertices(grid, probe, surface);
  EXPECT_EQ(surface.mesh.vertices, before);
}

// No vertex leaves its edge, even if the probe contradicts the grid.
TEST(RefineVertices, KeepsVerticesOnTheirEdges) {
  const FieldSnapshot ball = UnevenBall();
  const FieldGrid grid = SampleField(ball, SurfaceProbe(ball), {24, 24, 24}).grid;
  for (const float value : {1e30f, -1e30f, std::numeric_limits<float>::quiet_NaN(), 0.0f}) {
    const FieldSnapshot other = SnapshotOf([=](const Eigen::Vector3f&) { return value; });
    GridSurface surface = MarchingCubes(grid);
    RefineVertices(grid, SurfaceProbe(other), surface);
    for (size_t i = 0; i < surface.grid_edges.size(); ++i) {
      const Eigen::Vector3f offset = grid.ToNode(surface.mesh.vertices[i]) - grid.NodeAt(surface.grid_edges[i] / 3);
      const int axis = static_cast<int>(surface.grid_edges[i] % 3);
      for (int other_axis = 0; other_axis < 3; ++other_axis) {
        EXPECT_TRUE(other_axis == axis || std::abs(offset[other_axis]) < 1e-4f);
      }
      EXPECT_GT(offset[axis], 0);
      EXPECT_LT(offset[axis], 1);
    }
    EXPECT_TRUE(CheckTopology(surface.mesh).IsClosedManifold());
  }
}

}  // namespace romap::mesh::refine_vertices_test
