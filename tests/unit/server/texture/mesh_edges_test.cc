#include "server/texture/mesh_edges.h"

#include <gtest/gtest.h>

#include "common/mesh_faces.h"
#include "tests/unit/server/texture/texture_scenes.h"

namespace romap::texture::mesh_edges_test {

TEST(FaceNeighborsTest, NeighborsShareTheEdge) {
  const Mesh mesh = SphereMesh(6);
  const std::vector<FaceNeighbors> neighbors = FindFaceNeighbors(mesh.triangles);
  for (size_t face = 0; face < neighbors.size(); ++face) {
    for (int i = 0; i < 3; ++i) {
      ASSERT_NE(neighbors[face][i], kNoFace);
      const auto& other = mesh.triangles[neighbors[face][i]];
      int found = 0;
      for (int j = 0; j < 3; ++j) {
        found += other[j] == mesh.triangles[face][(i + 1) % 3] && other[(j + 1) % 3] == mesh.triangles[face][i];
      }
      EXPECT_EQ(found, 1);
    }
  }
}

TEST(FaceNeighborsTest, BordersAndCrossingsHaveNone) {
  const auto neighbors = FindFaceNeighbors({{0, 1, 2}, {1, 0, 3}, {1, 0, 4}, {2, 1, 5}});
  EXPECT_EQ(neighbors[0], (FaceNeighbors{kNoFace, 3, kNoFace}));
  EXPECT_EQ(neighbors[3], (FaceNeighbors{0, kNoFace, kNoFace}));
  EXPECT_EQ(neighbors[1], (FaceNeighbors{kNoFace, kNoFace, kNoFace}));
  EXPECT_EQ(FindFaceNeighbors({{0, 1, 2}, {0, 1, 3}})[0][0], kNoFace) << "the directions are the same";
}

TEST(FaceShapesTest, NormalsPointOutward) {
  const FaceShapes shapes(BoxMesh(4, {1, 2, 3}));
  EXPECT_NEAR(shapes.total_area_mu2, 8 * (1 * 2 + 2 * 3 + 3 * 1), 1e-3);
  const Mesh sphere = SphereMesh(8);
  const FaceShapes round(sphere);
  for (size_t face = 0; face < sphere.triangles.size(); ++face) {
    EXPECT_GT(round.normal[face].dot(sphere.vertices[sphere.triangles[face][0]]), 0.9f);
  }
}

// However the triangles are divided, the corner of a cube points along its diagonal.
TEST(VertexNormalsTest, DoNotDependOnTheTriangulation) {
  Mesh box = BoxMesh(1, {1, 1, 1});
  SetAngleWeightedNormals(box);
  for (size_t i = 0; i < box.vertices.size(); ++i) {
    EXPECT_TRUE(box.normals[i].isApprox(box.vertices[i].normalized(), 1e-4f)) << box.normals[i].transpose();
  }
}

TEST(NumberByPositionTest, CopiesHaveTheSameNumber) {
  Mesh mesh;
  mesh.vertices = {{1, 2, 3}, {0, 0, 0}, {1, 2, 3}, {0, 0, 1}};
  const std::vector<uint32_t> numbers = NumberByPosition(mesh);
  EXPECT_EQ(numbers, (std::vector<uint32_t>{2, 0, 2, 1}));
}

}  // namespace romap::texture::mesh_edges_test
