#include "server/mesh/vertex_normals.h"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "server/mesh/marching_cubes.h"
#include "server/mesh/sample_field.h"
#include "tests/unit/server/mesh/field_fakes.h"

namespace romap::mesh::vertex_normals_test {

constexpr float kRadius = 0.6f;

Mesh MakeBall(const Eigen::Vector3i& nodes) {
  const FieldSnapshot snapshot = SnapshotOf(Sphere(kRadius));
  Mesh ball = MarchingCubes(SampleField(snapshot, SurfaceProbe(snapshot), nodes).grid).mesh;
  for (Eigen::Vector3f& p : ball.vertices) p *= kRadius / p.norm();
  return ball;
}

std::vector<double> AnglesDeg(const Mesh& ball) {
  std::vector<double> angles;
  for (size_t i = 0; i < ball.vertices.size(); ++i) {
    const double cosine = ball.normals[i].dot(ball.vertices[i].normalized());
    angles.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi);
  }
  return angles;
}

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

TEST(VertexNormals, PointOutwardOnABall) {
  Mesh ball = MakeBall({40, 30, 20});
  SetVertexNormals(ball);
  ASSERT_EQ(ball.normals.size(), ball.vertices.size());
  const std::vector<double> angles = AnglesDeg(ball);
  EXPECT_LT(*std::max_element(angles.begin(), angles.end()), 7);
  EXPECT_LT(Mean(angles), 2.5);
  for (const Eigen::Vector3f& normal : ball.normals) EXPECT_NEAR(normal.norm(), 1, 1e-5f);
}

// Noise as on the surface of a trained field. The mean of the adjacent triangles alone would be off by 15 degrees.
TEST(VertexNormals, AreSmoothOnARoughSurface) {
  Mesh ball = MakeBall({40, 40, 40});
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0, 0.006f);  // an eighth of a cell
  for (Eigen::Vector3f& p : ball.vertices) p *= 1 + noise(random) / kRadius;
  SetVertexNormals(ball);
  EXPECT_LT(Mean(AnglesDeg(ball)), 6);
}

TEST(VertexNormals, AreExactOnAPlaneForAnyCellShape) {
  const Eigen::Vector3f up = Eigen::Vector3f(1, 2, 3).normalized();
  const FieldSnapshot snapshot = SnapshotOf([&](const Eigen::Vector3f& p) { return 0.1f - up.dot(p); });
  Mesh mesh = MarchingCubes(SampleField(snapshot, SurfaceProbe(snapshot), {40, 20, 10}).grid).mesh;
  for (Eigen::Vector3f& p : mesh.vertices) {
    if (p.cwiseAbs().maxCoeff() < 0.9f) p -= (up.dot(p) - 0.1f) * up;
  }
  SetVertexNormals(mesh);
  size_t checked = 0;
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (mesh.vertices[i].cwiseAbs().maxCoeff() > 0.5f) continue;  // near the sides of the box
    EXPECT_GT(mesh.normals[i].dot(up), 0.9999f);
    ++checked;
  }
  EXPECT_GT(checked, 100u);
}

TEST(VertexNormals, HaveUnitLengthOnTrianglesWithoutArea) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {1, 1, 1}};
  mesh.triangles = {{0, 1, 2}};
  SetVertexNormals(mesh);
  for (const Eigen::Vector3f& normal : mesh.normals) EXPECT_EQ(normal, Eigen::Vector3f::UnitZ());
}

}  // namespace romap::mesh::vertex_normals_test
