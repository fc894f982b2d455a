#include "server/texture/manifold.h"

#include <gtest/gtest.h>

#include "tests/unit/server/texture/mesh_topology.h"

namespace romap::texture::manifold_test {

using Triangles = std::vector<std::array<uint32_t, 3>>;

Mesh ToMesh(const std::vector<Eigen::Vector3f>& vertices, const ManifoldTriangles& manifold) {
  Mesh mesh;
  for (const uint32_t source : manifold.source) mesh.vertices.push_back(vertices[source]);
  mesh.triangles = manifold.triangles;
  return mesh;
}

// Two tetrahedra on opposite sides of the edge 0-1.
const std::vector<Eigen::Vector3f> kVertices = {{0, 0, 0},     {0, 0, 1},     {1, 0.5f, 0},
                                                {1, -0.5f, 0}, {-1, 0.5f, 0}, {-1, -0.5f, 0}};
Triangles Tetrahedron(uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
  return {{a, b, c}, {a, c, d}, {a, d, b}, {b, d, c}};
}
Triangles TwoTetrahedra() {
  Triangles triangles = Tetrahedron(0, 1, 2, 3);
  const Triangles other = Tetrahedron(0, 1, 5, 4);
  triangles.insert(triangles.end(), other.begin(), other.end());
  return triangles;
}

TEST(MakeManifoldTest, SeparatesSolidsThatShareAnEdge) {
  EXPECT_FALSE(IsClosedSurface(
      {.vertices = kVertices, .normals = {}, .colors = {}, .confidence = {}, .triangles = TwoTetrahedra()}));
  const ManifoldTriangles manifold = MakeManifold(kVertices, TwoTetrahedra());
  EXPECT_EQ(manifold.triangles.size(), 8u);
  EXPECT_EQ(manifold.source.size(), 8u);
  EXPECT_TRUE(manifold.is_manifold);
  EXPECT_TRUE(IsClosedSurface(ToMesh(kVertices, manifold)));
}

TEST(MakeManifoldTest, RemovesFlatParts) {
  Triangles triangles = Tetrahedron(0, 1, 2, 3);
  triangles.push_back({0, 4, 5});
  triangles.push_back({5, 4, 0});
  triangles.push_back({1, 1, 2});
  const ManifoldTriangles manifold = MakeManifold(kVertices, triangles);
  EXPECT_EQ(manifold.triangles.size(), 4u);
  EXPECT_EQ(manifold.source.size(), 4u);
  EXPECT_TRUE(IsClosedSurface(ToMesh(kVertices, manifold)));
}

TEST(MakeManifoldTest, KeepsAnOpenSurfaceOpen) {
  const ManifoldTriangles manifold = MakeManifold(kVertices, {{0, 1, 2}, {0, 2, 3}});
  EXPECT_EQ(manifold.triangles.size(), 2u);
  EXPECT_EQ(manifold.source.size(), 4u);
}

TEST(MakeManifoldTest, ATriangleThatOccursTwiceGetsItsOwnVertices) {
  Triangles triangles = Tetrahedron(0, 1, 2, 3);
  triangles.push_back(triangles[0]);
  const ManifoldTriangles manifold = MakeManifold(kVertices, triangles);
  EXPECT_EQ(manifold.triangles.size(), 5u);
  EXPECT_GE(manifold.source.size(), 6u);
}

}  // namespace romap::texture::manifold_test
