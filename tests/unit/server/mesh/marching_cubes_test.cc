#include "server/mesh/marching_cubes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/mesh/marching_cubes_table.h"
#include "tests/unit/server/mesh/mesh_checks.h"

namespace romap::mesh::marching_cubes_test {

template <class Value>
FieldGrid GridOf(int resolution, Value value) {
  FieldGrid grid = MakeEmptyGrid(Eigen::Vector3i::Constant(resolution), Eigen::Vector3f::Ones());
  for (int z = 1; z <= resolution; ++z) {
    for (int y = 1; y <= resolution; ++y) {
      for (int x = 1; x <= resolution; ++x) grid.value[grid.Index(x, y, z)] = value(x, y, z);
    }
  }
  return grid;
}

double ShortestSide(const Mesh& mesh) {
  double shortest = 1e9;
  for (const auto& triangle : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      const Eigen::Vector3f side = mesh.vertices[triangle[(i + 1) % 3]] - mesh.vertices[triangle[i]];
      shortest = std::min<double>(shortest, side.norm());
    }
  }
  return shortest;
}

TEST(MarchingCubesTable, CrossesExactlyTheEdgesWhoseCornersDiffer) {
  const MarchingCubesTable& table = GetMarchingCubesTable();
  for (int pattern = 0; pattern < 256; ++pattern) {
    int used = 0;
    for (const auto& triangle : table[pattern]) {
      for (const uint8_t edge : triangle) used |= 1 << edge;
    }
    for (int edge = 0; edge < kCellEdges; ++edge) {
      const int low = EdgeCorner(edge);
      const int high = low | 1 << EdgeAxis(edge);
      EXPECT_EQ((pattern >> low & 1) != (pattern >> high & 1), (used >> edge & 1) != 0)
          << "pattern " << pattern << " edge " << edge;
    }
  }
}

TEST(MarchingCubesTable, OneInsideCornerGivesOneOutwardTriangle) {
  const MarchingCubesTable& table = GetMarchingCubesTable();
  for (int corner = 0; corner < kCellCorners; ++corner) {
    ASSERT_EQ(table[1 << corner].size(), 1u);
    std::array<Eigen::Vector3f, 3> p;
    for (int i = 0; i < 3; ++i) {
      const int edge = table[1 << corner][0][i];
      const int low = EdgeCorner(edge);
      p[i] = Eigen::Vector3f(low & 1, low >> 1 & 1, low >> 2 & 1);
      p[i][EdgeAxis(edge)] = 0.5f;
    }
    const Eigen::Vector3f at(corner & 1, corner >> 1 & 1, corner >> 2 & 1);
    EXPECT_GT((p[1] - p[0]).cross(p[2] - p[0]).dot(p[0] - at), 0) << "corner " << corner;
  }
}

TEST(MarchingCubes, RandomGridsGiveClosedManifolds) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> uniform(-4.0f, 4.0f);
  for (const float shift : {0.0f, 2.5f, -3.0f}) {
    for (int round = 0; round < 6; ++round) {
      const FieldGrid grid = GridOf(14, [&](int, int, int) { return uniform(random) + shift; });
      const Mesh mesh = MarchingCubes(grid).mesh;
      const Topology topology = CheckTopology(mesh);
      EXPECT_GT(mesh.triangles.size(), 500u);
      EXPECT_EQ(topology.bad_edges, 0u) << "shift " << shift << " round " << round;
      EXPECT_EQ(topology.bad_vertices, 0u) << "shift " << shift << " round " << round;
      EXPECT_GT(Volume(mesh), 0);
      EXPECT_GT(ShortestSide(mesh), 0);
    }
  }
}

// Every face of the grid is ambiguous.
TEST(MarchingCubes, CheckerboardsGiveClosedManifolds) {
  for (const int odd : {0, 1}) {
    const FieldGrid grid = GridOf(9, [&](int x, int y, int z) { return (x + y + z) % 2 == odd ? 1.0f : -1.0f; });
    const Mesh mesh = MarchingCubes(grid).mesh;
    EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
    EXPECT_EQ(CheckTopology(mesh).components, odd ? 365u : 364u);  // inside corners are separated: one component each
  }
}

TEST(MarchingCubes, ValuesAtAndFarFromTheLevelGiveNoDegenerateTriangles) {
  std::mt19937 random(11);
  const float values[] = {0.0f, 1e-30f, -1e-30f, 1e4f, kEmpty, 1e-3f};
  const FieldGrid grid = GridOf(14, [&](int, int, int) { return values[random() % 6]; });
  const Mesh mesh = MarchingCubes(grid).mesh;
  EXPECT_TRUE(CheckTopology(mesh).IsClosedManifold());
  EXPECT_GT(ShortestSide(mesh), 1e-4 * grid.spacing.x());
  for (const Eigen::Vector3f& p : mesh.vertices) ASSERT_TRUE(p.allFinite());
}

TEST(MarchingCubes, PlacesVerticesOfALinearFieldExactly) {
  const Eigen::Vector3f normal = Eigen::Vector3f(1, 2, -0.5f).normalized();
  const FieldGrid grid = [&] {
    FieldGrid g = MakeEmptyGrid({16, 16, 16}, Eigen::Vector3f::Ones());
    return GridOf(16, [&](int x, int y, int z) { return -normal.dot(g.Position(Eigen::Vector3f(x, y, z))) - 0.03f; });
  }();
  const Mesh mesh = MarchingCubes(grid).mesh;
  size_t inner = 0;
  for (const Eigen::Vector3f& p : mesh.vertices) {
    if (p.cwiseAbs().maxCoeff() > 1.0f) continue;  // on the box
    EXPECT_NEAR(normal.dot(p), -0.03f, 2e-4f);     // vertices keep a thousandth of an edge away from nodes
    ++inner;
  }
  EXPECT_GT(inner, 150u);
}

TEST(MarchingCubes, ClosesAtTheBoxIfAllNodesAreInside) {
  const FieldGrid grid = GridOf(8, [](int, int, int) { return 5.0f; });
  const Mesh mesh = MarchingCubes(grid).mesh;
  const Topology topology = CheckTopology(mesh);
  EXPECT_TRUE(topology.IsClosedManifold());
  EXPECT_EQ(topology.euler_characteristic, 2);
  EXPECT_NEAR(Volume(mesh), 8.0, 8.0 * 0.02);
  for (const Eigen::Vector3f& p : mesh.vertices) EXPECT_LT(p.cwiseAbs().maxCoeff(), 1.0f + 0.01f);
}

TEST(MarchingCubes, EmptyGridGivesEmptyMesh) {
  const Mesh mesh = MarchingCubes(MakeEmptyGrid({8, 8, 8}, Eigen::Vector3f::Ones())).mesh;
  EXPECT_TRUE(mesh.vertices.empty());
  EXPECT_TRUE(mesh.triangles.empty());
}

}  // namespace romap::mesh::marching_cubes_test
