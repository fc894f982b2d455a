#include "client/eval/points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval::points_test {

TEST(SampleSurfaceTest, SamplesUniformlyByArea) {
  Mesh mesh = eval_world::Box({1, 2, 3}, {0, 0, 0});
  const auto points = SampleSurface(mesh, 40000, 1, "box");
  ASSERT_TRUE(points.ok());
  int on_x_sides = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : *points) {
    on_x_sides += std::abs(std::abs(p.x()) - 1) < 1e-12;
    mean += p / static_cast<double>(points->size());
  }
  EXPECT_NEAR(on_x_sides / 40000.0, 2 * 24 / 88.0, 0.01) << "24 of 44 units of area";
  EXPECT_LT(mean.norm(), 0.04);
  EXPECT_EQ(*points, *SampleSurface(mesh, 40000, 1, "box"));
  mesh.triangles = {{0, 0, 1}};
  EXPECT_EQ(SampleSurface(mesh, 10, 1, "line").status().message(), "line: the mesh has no area");
  mesh.triangles.clear();
  EXPECT_EQ(SampleSurface(mesh, 10, 1, "cloud")->size(), 8u) << "all points of a cloud";
}

TEST(NearestIndexTest, AgreesWithExhaustiveSearch) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto draw = [&](size_t count) {
    Points points(count);
    for (Eigen::Vector3d& p : points) p = {uniform(random), uniform(random), uniform(random)};
    return points;
  };
  const Points points = draw(500), queries = draw(300);
  const Neighbors found = NearestIndex(points).Query(queries);
  for (size_t k = 0; k < queries.size(); ++k) {
    double best = 1e9;
    for (const Eigen::Vector3d& p : points) best = std::min(best, (p - queries[k]).norm());
    EXPECT_NEAR(found.distance[k], best, 1e-12);
    EXPECT_NEAR((points[found.index[k]] - queries[k]).norm(), best, 1e-12);
  }
}

}  // namespace romap::eval::points_test
