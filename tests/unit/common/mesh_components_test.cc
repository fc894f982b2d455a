#include "common/mesh_components.h"

#include <gtest/gtest.h>

namespace romap::mesh_components_test {

TEST(MeshComponentsTest, TrianglesThatShareAVertexAreConnected) {
  Mesh mesh;
  mesh.vertices.assign(9, Eigen::Vector3f::Zero());
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}, {2, 6, 7}};
  EXPECT_EQ(CountComponents(mesh), 2u) << "vertex 8 has no triangle";
  mesh.triangles.push_back({7, 3, 1});
  EXPECT_EQ(CountComponents(mesh), 1u);
}

TEST(MeshComponentsTest, EmptyMesh) { EXPECT_EQ(CountComponents({}), 0u); }

}  // namespace romap::mesh_components_test
