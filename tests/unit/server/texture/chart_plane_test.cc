#include "server/texture/chart_plane.h"

#include <gtest/gtest.h>

namespace romap::texture::chart_plane_test {

ChartPlane::Triangle Flat(double x0, double y0, double x1, double y1, double x2, double y2) {
  return {Eigen::Vector2d(x0, y0), Eigen::Vector2d(x1, y1), Eigen::Vector2d(x2, y2)};
}

TEST(TrianglesOverlapTest, OnlyCommonInteriorsCount) {
  const ChartPlane::Triangle triangle = Flat(0, 0, 1, 0, 0, 1);
  EXPECT_TRUE(TrianglesOverlap(triangle, triangle));
  EXPECT_TRUE(TrianglesOverlap(triangle, Flat(0.1, 0.1, 0.2, 0.1, 0.1, 0.2)));
  EXPECT_TRUE(TrianglesOverlap(triangle, Flat(0.4, 0.4, 2, 0.4, 2, 2)));
  EXPECT_FALSE(TrianglesOverlap(triangle, Flat(1, 0, 1, 1, 0, 1)));                       // common edge
  EXPECT_FALSE(TrianglesOverlap(triangle, Flat(1, 0, 2, 0, 2, 1)));                       // common vertex
  EXPECT_FALSE(TrianglesOverlap(triangle, Flat(0.6, 0.6, 2, 0, 2, 2)));                   // apart
  EXPECT_TRUE(TrianglesOverlap(Flat(0, 1, 1, 0, 0, 0), Flat(0.2, 0.2, 1, 0.5, 0.5, 1)));  // any orientation
}

TEST(ChartPlaneTest, RejectsReversedAndOverlappingTriangles) {
  ChartPlane plane({0, 0, 1}, 0.3f);
  EXPECT_TRUE(plane.TryAdd({Eigen::Vector3f(0, 0, 0), {1, 0, 0}, {0, 1, 0}}));
  EXPECT_FALSE(plane.TryAdd({Eigen::Vector3f(1, 0, 0), {0, 1, 0}, {1, 1, 0}}));  // clockwise from above
  EXPECT_TRUE(plane.TryAdd({Eigen::Vector3f(1, 0, 0), {1, 1, 0}, {0, 1, 0}}));
  EXPECT_FALSE(plane.TryAdd({Eigen::Vector3f(0.1f, 0.1f, 5), {0.3f, 0.1f, 5}, {0.1f, 0.3f, 5}}));  // above another one
  EXPECT_FALSE(plane.TryAdd({Eigen::Vector3f(3, 0, 0), {4, 0, 0}, {5, 0, 0}}));                    // without area
  EXPECT_EQ(plane.Count(), 2u);
  plane.ShrinkTo(1);
  EXPECT_TRUE(plane.TryAdd({Eigen::Vector3f(0.6f, 0.6f, 5), {0.9f, 0.6f, 5}, {0.6f, 0.9f, 5}}));
  plane.ShrinkTo(0);
  EXPECT_TRUE(plane.TryAdd({Eigen::Vector3f(0.1f, 0.1f, 5), {0.3f, 0.1f, 5}, {0.1f, 0.3f, 5}}));
}

TEST(PlaneProjectionTest, IsNotMirrored) {
  for (const Eigen::Vector3f& normal :
       {Eigen::Vector3f(0, 0, 1), Eigen::Vector3f(0, -1, 0), Eigen::Vector3f(1, 0, 0)}) {
    const PlaneProjection project(normal);
    const Eigen::Vector3f u = normal.unitOrthogonal(), v = normal.cross(u);
    const Eigen::Vector2f a = project(u), b = project(v);
    EXPECT_NEAR(a.x() * b.y() - a.y() * b.x(), -1, 1e-5) << "counter-clockwise in an image with y down";
  }
}

}  // namespace romap::texture::chart_plane_test
