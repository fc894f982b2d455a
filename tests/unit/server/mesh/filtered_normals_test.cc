#include "server/mesh/filtered_normals.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "server/mesh/extract_mesh.h"
#include "server/mesh/vertex_normals.h"
#include "tests/unit/server/mesh/field_fakes.h"

namespace romap::mesh::filtered_normals_test {

InsideDistance Box(float half) {
  return [=](const Eigen::Vector3f& p) { return half - p.cwiseAbs().maxCoeff(); };
}

// The mesh of a box with random shifts of its vertices by a few percent of an edge.
Mesh NoisyBox() {
  Mesh mesh = *ExtractMesh(SnapshotOf(Box(0.6f)), {});
  std::mt19937 random(1);
  std::normal_distribution<float> noise(0, 0.003f);  // the distance between vertices is 0.03
  for (Eigen::Vector3f& vertex : mesh.vertices) {
    for (int axis = 0; axis < 3; ++axis) vertex[axis] += noise(random);
  }
  return mesh;
}

// Mean angle to the normal of the face of the box, over vertices that are at least `margin` from its edges [rad].
double Error(const Mesh& mesh, float margin) {
  double sum = 0;
  int count = 0;
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    Eigen::Index axis = 0;
    const Eigen::Vector3f size = mesh.vertices[v].cwiseAbs();
    size.maxCoeff(&axis);
    Eigen::Vector3f others = size;
    others[axis] = 0;
    if (others.maxCoeff() > 0.6f - margin) continue;
    const float cosine = mesh.normals[v][axis] * (mesh.vertices[v][axis] > 0 ? 1.0f : -1.0f);
    sum += std::acos(std::clamp(cosine, -1.0f, 1.0f));
    ++count;
  }
  return sum / count;
}

TEST(FilteredNormalsTest, FlatSidesHaveLessNoiseThanWithoutTheFilter) {
  Mesh mesh = NoisyBox();
  SetVertexNormals(mesh);
  const double before = Error(mesh, 0.1f);
  SetFilteredNormals(mesh);
  EXPECT_LT(Error(mesh, 0.1f), 0.5 * before);
}

TEST(FilteredNormalsTest, EdgesStaySharp) {
  Mesh mesh = NoisyBox();
  SetVertexNormals(mesh);
  const double before = Error(mesh, 0.06f);
  SetFilteredNormals(mesh);
  EXPECT_LT(Error(mesh, 0.06f), before) << "two vertices from an edge";
}

TEST(FilteredNormalsTest, NormalsHaveUnitLengthAndVerticesStay) {
  Mesh mesh = NoisyBox();
  const std::vector<Eigen::Vector3f> vertices = mesh.vertices;
  SetFilteredNormals(mesh);
  EXPECT_EQ(mesh.vertices, vertices);
  ASSERT_EQ(mesh.normals.size(), vertices.size());
  for (const Eigen::Vector3f& normal : mesh.normals) EXPECT_NEAR(normal.norm(), 1, 1e-5);
}

TEST(FilteredNormalsTest, DegenerateTrianglesHaveFiniteNormals) {
  Mesh mesh;
  mesh.vertices.assign(4, Eigen::Vector3f::Zero());
  mesh.triangles = {{0, 1, 2}};
  SetFilteredNormals(mesh);
  for (const Eigen::Vector3f& normal : mesh.normals) EXPECT_NEAR(normal.norm(), 1, 1e-5);
}

}  // namespace romap::mesh::filtered_normals_test
