#include "server/mesh/vertex_normals.h"

#include <gtest/gtest.h>

#include <numbers>

#include "server/mesh/sample_field.h"
#include "tests/unit/server/mesh/field_fakes.h"

namespace romap {
namespace {

struct Ball {
  FieldGrid grid;
  GridSurface surface;
};

Ball MakeBall() {
  const FieldSnapshot snapshot = SnapshotOf(Sphere(0.6f));
  Ball ball{SampleField(snapshot, SurfaceProbe(snapshot), {40, 30, 20}).grid, {}};
  ball.surface = MarchingCubes(ball.grid);
  return ball;
}

double WorstAngleDeg(const Mesh& mesh) {
  double worst = 0;
  for (size_t i = 0; i < mesh.vertices.size(); ++i) {
    const double cosine = mesh.normals[i].dot(mesh.vertices[i].normalized());
    worst = std::max(worst, std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / std::numbers::pi);
  }
  return worst;
}

TEST(VertexNormals, OfTheFieldAreFarBetterThanOfTheTriangles) {
  Ball ball = MakeBall();
  SetAreaNormals(ball.surface.mesh);
  const double of_area = WorstAngleDeg(ball.surface.mesh);
  const FieldSnapshot snapshot = SnapshotOf(Sphere(0.6f));
  SetFieldNormals(ball.grid, SurfaceProbe(snapshot), ball.surface);
  EXPECT_GT(of_area, 2);
  EXPECT_LT(WorstAngleDeg(ball.surface.mesh), 0.5);
  for (const Eigen::Vector3f& normal : ball.surface.mesh.normals) EXPECT_NEAR(normal.norm(), 1, 1e-5f);
}

// Cells are not cubes here: the gradient must be in map units, not in nodes.
TEST(VertexNormals, OfAPlaneAreExactWhateverTheCells) {
  const Eigen::Vector3f up = Eigen::Vector3f(1, 2, 3).normalized();
  const FieldSnapshot snapshot = SnapshotOf([&](const Eigen::Vector3f& p) { return 0.1f - up.dot(p); });
  const SurfaceProbe probe(snapshot);
  const FieldGrid grid = SampleField(snapshot, probe, {40, 20, 10}).grid;
  GridSurface surface = MarchingCubes(grid);
  SetFieldNormals(grid, probe, surface);
  size_t checked = 0;
  for (size_t i = 0; i < surface.mesh.vertices.size(); ++i) {
    if (surface.mesh.vertices[i].cwiseAbs().maxCoeff() > 0.9f) continue;  // where the box closes the surface
    EXPECT_GT(surface.mesh.normals[i].dot(up), 0.9999f);
    ++checked;
  }
  EXPECT_GT(checked, 100u);
}

TEST(VertexNormals, AFieldThatContradictsTheSurfaceOrSaysNothingIsNotBelieved) {
  Ball ball = MakeBall();
  SetAreaNormals(ball.surface.mesh);
  const std::vector<Eigen::Vector3f> of_area = ball.surface.mesh.normals;
  const InsideDistance inside_out = [](const Eigen::Vector3f& p) { return -Sphere(0.6f)(p); };
  const InsideDistance even = [](const Eigen::Vector3f&) { return 0.2f; };
  const InsideDistance nan = [](const Eigen::Vector3f&) { return std::numeric_limits<float>::quiet_NaN(); };
  for (const InsideDistance& field : {inside_out, even, nan}) {
    const FieldSnapshot snapshot = SnapshotOf(field);
    SetFieldNormals(ball.grid, SurfaceProbe(snapshot), ball.surface);
    EXPECT_EQ(ball.surface.mesh.normals, of_area);
  }
}

}  // namespace
}  // namespace romap
