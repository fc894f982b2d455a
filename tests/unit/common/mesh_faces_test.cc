#include "common/mesh_faces.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace romap::mesh_faces_test {

TEST(MeshFacesTest, ShapesOfTriangles) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {2, 0, 0}, {0, 3, 0}, {0, 6, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  const FaceShapes shapes(mesh);
  EXPECT_EQ(shapes.normal[0], Eigen::Vector3f::UnitZ());
  EXPECT_EQ(shapes.area_mu2[0], 3);
  EXPECT_TRUE(shapes.center[0].isApprox(Eigen::Vector3f(2.0f / 3, 1, 0)));
  EXPECT_EQ(shapes.normal[1], Eigen::Vector3f::Zero()) << "without area";
  EXPECT_EQ(shapes.total_area_mu2, 3);
}

TEST(MeshFacesTest, TrianglesAtVertices) {
  Mesh mesh;
  mesh.vertices.resize(5);
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  const VertexTriangles triangles(mesh);
  EXPECT_THAT(triangles.At(0), ::testing::ElementsAre(0, 1));
  EXPECT_THAT(triangles.At(1), ::testing::ElementsAre(0));
  EXPECT_THAT(triangles.At(3), ::testing::ElementsAre(1));
  EXPECT_THAT(triangles.At(4), ::testing::IsEmpty());
}

TEST(MeshFacesTest, Bounds) {
  Mesh mesh;
  EXPECT_TRUE(BoundsOf(mesh).isEmpty());
  mesh.vertices = {{1, -2, 3}, {-1, 2, 0}};
  EXPECT_EQ(BoundsOf(mesh).min(), Eigen::Vector3f(-1, -2, 0));
  EXPECT_EQ(BoundsOf(mesh).max(), Eigen::Vector3f(1, 2, 3));
}

}  // namespace romap::mesh_faces_test
