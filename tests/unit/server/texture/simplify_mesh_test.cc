#include "server/texture/simplify_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/unit/server/texture/mesh_topology.h"
#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::simplify_mesh_test {

float LargestRadiusError(const Mesh& mesh) {
  float largest = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3f center = (mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3.0f;
    largest = std::max(largest, std::abs(center.norm() - 1.0f));
  }
  return largest;
}

TEST(SimplifyMeshTest, KeepsTheErrorBelowTheLimitAndTheSurfaceClosed) {
  const Mesh sphere = SphereMesh(50);
  const Simplified simplified = SimplifyMesh(sphere, {.max_triangles = 100000, .max_error_mu = 0.004f});
  EXPECT_LT(simplified.mesh.triangles.size(), sphere.triangles.size() / 5);
  EXPECT_GT(simplified.mesh.triangles.size(), 50u);
  EXPECT_LE(simplified.error_mu, 0.004f);
  EXPECT_GT(simplified.error_mu, 0.0f);
  EXPECT_LT(LargestRadiusError(simplified.mesh), 0.012f);  // at the centers of triangles, about twice the mean square
  EXPECT_TRUE(IsClosedSurface(simplified.mesh));
  EXPECT_NEAR(EnclosedVolume(simplified.mesh), EnclosedVolume(sphere), 0.06);
}

TEST(SimplifyMeshTest, KeepsAFlatBoxExact) {
  const Simplified simplified =
      SimplifyMesh(BoxMesh(24, {1, 0.5, 0.25}), {.max_triangles = 8000, .max_error_mu = 1e-4f});
  EXPECT_LE(simplified.mesh.triangles.size(), 100u);
  EXPECT_TRUE(IsClosedSurface(simplified.mesh));
  EXPECT_NEAR(EnclosedVolume(simplified.mesh), 1.0, 1e-3);
}

TEST(SimplifyMeshTest, ReducesToTheNumberOfTrianglesWhateverTheError) {
  const Simplified simplified = SimplifyMesh(RoughMesh(60), {.max_triangles = 3000, .max_error_mu = 0.0f});
  EXPECT_LE(simplified.mesh.triangles.size(), 3000u);
  EXPECT_GT(simplified.mesh.triangles.size(), 2900u);
  EXPECT_TRUE(IsClosedSurface(simplified.mesh));
}

TEST(SimplifyMeshTest, KeepsTheAttributesOfTheVertices) {
  Mesh mesh = SphereMesh(20);
  for (const Eigen::Vector3f& p : mesh.vertices) {
    mesh.colors.push_back({static_cast<uint8_t>(100 + 100 * p.x()), static_cast<uint8_t>(100 + 100 * p.y()), 7});
    mesh.confidence.push_back(0.5f + 0.4f * p.z());
  }
  const SimplifyOptions options = {.max_triangles = 400, .max_error_mu = 0.0f};
  for (const Eigen::Vector3f& normal : SimplifyMesh(mesh, options).mesh.normals) EXPECT_NEAR(normal.norm(), 1, 1e-5);
  for (const Eigen::Vector3f& p : mesh.vertices) mesh.normals.push_back(-p.normalized());
  const Mesh result = SimplifyMesh(mesh, options).mesh;
  ASSERT_EQ(result.colors.size(), result.vertices.size());
  ASSERT_EQ(result.confidence.size(), result.vertices.size());
  ASSERT_EQ(result.normals.size(), result.vertices.size());
  for (size_t i = 0; i < result.vertices.size(); ++i) {
    EXPECT_EQ(result.colors[i][0], static_cast<uint8_t>(100 + 100 * result.vertices[i].x()));
    EXPECT_EQ(result.confidence[i], 0.5f + 0.4f * result.vertices[i].z());
    EXPECT_EQ(result.normals[i], -result.vertices[i].normalized());
  }
}

// Collapsing a tube that is thinner than the error makes surfaces touch each other.
TEST(SimplifyMeshTest, ThinPartsStayManifold) {
  for (const double tube_mu : {0.002, 0.01, 0.03, 0.1}) {
    for (const float error_mu : {0.005f, 0.02f, 0.05f, 0.2f}) {
      Mesh mesh = TorusMesh(300, 12, tube_mu);
      const Mesh sphere = SphereMesh(20, 0.5);
      const auto first = static_cast<uint32_t>(mesh.vertices.size());
      mesh.vertices.insert(mesh.vertices.end(), sphere.vertices.begin(), sphere.vertices.end());
      for (const auto& [a, b, c] : sphere.triangles) mesh.triangles.push_back({first + a, first + b, first + c});
      const Simplified simplified = SimplifyMesh(mesh, {.max_triangles = 1000, .max_error_mu = error_mu});
      EXPECT_TRUE(IsClosedSurface(simplified.mesh)) << tube_mu << " " << error_mu;
      EXPECT_LE(simplified.mesh.triangles.size(), 1000u) << tube_mu << " " << error_mu;
      EXPECT_GT(EnclosedVolume(simplified.mesh), 0.2) << tube_mu << " " << error_mu;
    }
  }
}

TEST(SimplifyMeshTest, DegenerateMeshesAreReturned) {
  EXPECT_TRUE(SimplifyMesh({}, {}).mesh.triangles.empty());
  Mesh triangle;
  triangle.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  triangle.triangles = {{0, 1, 2}};
  const Mesh result = SimplifyMesh(triangle, {.max_triangles = 1, .max_error_mu = 10.0f}).mesh;
  EXPECT_EQ(result.triangles, triangle.triangles);
  EXPECT_EQ(result.normals, std::vector<Eigen::Vector3f>(3, Eigen::Vector3f::UnitZ()));
  Mesh point = SphereMesh(4);
  for (Eigen::Vector3f& p : point.vertices) p = Eigen::Vector3f(1, 2, 3);
  EXPECT_EQ(SimplifyMesh(point, {}).mesh.triangles.size(), point.triangles.size());
}

}  // namespace romap::texture::simplify_mesh_test
