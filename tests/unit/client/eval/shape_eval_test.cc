#include "client/eval/shape_eval.h"

#include <gtest/gtest.h>

#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval::shape_eval_test {

OrientedPoints Sample(const Mesh& mesh) { return *SampleOrientedSurface(mesh, 30000, 1, "mesh"); }

Mesh Both(Mesh a, const Mesh& b) {
  const auto offset = static_cast<uint32_t>(a.vertices.size());
  a.vertices.insert(a.vertices.end(), b.vertices.begin(), b.vertices.end());
  for (auto triangle : b.triangles) {
    for (uint32_t& vertex : triangle) vertex += offset;
    a.triangles.push_back(triangle);
  }
  return a;
}

TEST(ShapeEvalTest, ASolidHasNoHollow) {
  const Mesh sphere = eval_world::Sphere(0.1, {0, 0, 0});
  const ShapeFigures figures = MeasureShape(Sample(sphere), Sample(sphere));
  EXPECT_LT(figures.accuracy_closed_cm, 0.05);
  EXPECT_EQ(figures.hollow_percent, 0);
  EXPECT_LT(*figures.normal_error_deg, 5);
}

// The inner sphere has 64 % of the area of the outer one.
TEST(ShapeEvalTest, ACavityIsHollow) {
  const Mesh truth = eval_world::Sphere(0.1, {0, 0, 0});
  const Mesh hollow = Both(truth, eval_world::Sphere(0.08, {0, 0, 0}));
  const ShapeFigures figures = MeasureShape(Sample(truth), Sample(hollow));
  EXPECT_NEAR(*figures.hollow_percent, 100 * 0.64 / 1.64, 1);
}

TEST(ShapeEvalTest, ASurfaceThatLiesOutsideIsNotHollow) {
  const ShapeFigures figures =
      MeasureShape(Sample(eval_world::Sphere(0.08, {0, 0, 0})), Sample(eval_world::Sphere(0.1, {0, 0, 0})));
  EXPECT_EQ(figures.hollow_percent, 0);
  EXPECT_FALSE(figures.normal_error_deg.has_value()) << "all points are too far away";
}

TEST(ShapeEvalTest, NormalsOfAMeshReplaceThoseOfItsTriangles) {
  Mesh mesh = eval_world::Sphere(0.1, {0, 0, 0});
  const OrientedPoints truth = Sample(mesh);
  mesh.normals.assign(mesh.vertices.size(), Eigen::Vector3f::UnitZ());
  EXPECT_NEAR(*MeasureShape(truth, Sample(mesh)).normal_error_deg, 90, 2);
}

TEST(ShapeEvalTest, WithoutTrueNormalsOnlyDistancesAreMeasured) {
  OrientedPoints truth = Sample(eval_world::Sphere(0.1, {0, 0, 0}));
  truth.normals.clear();
  const ShapeFigures figures = MeasureShape(truth, Sample(eval_world::Sphere(0.08, {0, 0, 0})));
  EXPECT_NEAR(figures.accuracy_closed_cm, 2, 0.05);
  EXPECT_FALSE(figures.hollow_percent.has_value());
  EXPECT_FALSE(figures.normal_error_deg.has_value());
}

}  // namespace romap::eval::shape_eval_test
