#include "server/texture/charts.h"

#include <gtest/gtest.h>

#include <set>

#include "common/mesh_faces.h"
#include "server/texture/chart_plane.h"
#include "server/texture/mesh_edges.h"
#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::charts_test {

void ExpectPartition(const Mesh& mesh, const std::vector<Chart>& charts) {
  const std::vector<FaceNeighbors> neighbors = FindFaceNeighbors(mesh.triangles);
  const FaceShapes shapes(mesh);
  std::set<uint32_t> all;
  for (const Chart& chart : charts) {
    const std::set<uint32_t> faces(chart.faces.begin(), chart.faces.end());
    std::set<uint32_t> reached = {chart.faces[0]};
    std::vector<uint32_t> open = {chart.faces[0]};
    while (!open.empty()) {
      const uint32_t face = open.back();
      open.pop_back();
      for (const uint32_t next : neighbors[face]) {
        if (faces.contains(next) && reached.insert(next).second) open.push_back(next);
      }
    }
    EXPECT_EQ(reached.size(), faces.size()) << "not connected";
    for (const uint32_t face : faces) {
      EXPECT_TRUE(all.insert(face).second);
      EXPECT_GE(shapes.normal[face].dot(chart.normal), std::cos(kMaxFaceAngle_rad) - 1e-5f);
    }
  }
  EXPECT_EQ(all.size(), mesh.triangles.size());
}

TEST(ChartsTest, ABoxHasOneChartPerSide) {
  const Mesh box = BoxMesh(12, {1, 0.7, 0.4});
  const std::vector<Chart> charts = DivideIntoCharts(box, {.max_angle_rad = 0.7f});
  EXPECT_EQ(charts.size(), 6u);
  ExpectPartition(box, charts);
  for (const Chart& chart : charts) EXPECT_NEAR(chart.normal.lpNorm<Eigen::Infinity>(), 1, 1e-3);
}

TEST(ChartsTest, RoundAndRoughMeshes) {
  for (const Mesh& mesh : {SphereMesh(16), RoughMesh(24), TorusMesh(60, 24, 0.4)}) {
    ExpectPartition(mesh, DivideIntoCharts(mesh, {}));
  }
}

// A ramp that winds around an axis is above itself after one turn, though all its normals are similar.
TEST(ChartsTest, ASurfaceAboveItselfIsDivided) {
  Mesh ramp;
  constexpr int kSteps = 120;
  for (int i = 0; i <= kSteps; ++i) {
    const double angle = 4 * std::numbers::pi * i / kSteps;  // two turns
    for (const double r : {0.5, 1.0})
      ramp.vertices.emplace_back(r * std::cos(angle), r * std::sin(angle), 0.02 * angle);
  }
  for (uint32_t i = 0; i < kSteps; ++i) {
    ramp.triangles.push_back({2 * i, 2 * i + 1, 2 * i + 3});
    ramp.triangles.push_back({2 * i, 2 * i + 3, 2 * i + 2});
  }
  const std::vector<Chart> charts = DivideIntoCharts(ramp, {});
  ExpectPartition(ramp, charts);
  EXPECT_GE(charts.size(), 2u);
  EXPECT_LE(charts.size(), 4u);
  for (const Chart& chart : charts) {
    ChartPlane plane(chart.normal, 0.1f);
    for (const uint32_t face : chart.faces) {
      const auto& [a, b, c] = ramp.triangles[face];
      EXPECT_TRUE(plane.TryAdd({ramp.vertices[a], ramp.vertices[b], ramp.vertices[c]}));
    }
  }
}

// A wire with triangles of its whole length: few cells, though its area is tiny.
TEST(ChartsTest, LongThinTriangles) {
  Mesh wire;
  constexpr uint32_t kSides = 600;
  const Eigen::Vector3f axis = Eigen::Vector3f(1, 1, 1).normalized();
  const Eigen::Vector3f u = axis.unitOrthogonal(), v = axis.cross(u);
  for (uint32_t i = 0; i < kSides; ++i) {
    const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i) / kSides;
    const Eigen::Vector3f around = 0.001f * (std::cos(angle) * u + std::sin(angle) * v);
    wire.vertices.push_back(around);
    wire.vertices.push_back(around + axis);
  }
  for (uint32_t i = 0; i < kSides; ++i) {
    const uint32_t a = 2 * i, b = 2 * ((i + 1) % kSides);
    wire.triangles.push_back({a, b, b + 1});
    wire.triangles.push_back({a, b + 1, a + 1});
  }
  const std::vector<Chart> charts = DivideIntoCharts(wire, {});
  ExpectPartition(wire, charts);
  EXPECT_LE(charts.size(), 8u);
}

TEST(ChartsTest, AnEmptyMeshHasNoCharts) { EXPECT_TRUE(DivideIntoCharts({}, {}).empty()); }

}  // namespace romap::texture::charts_test
