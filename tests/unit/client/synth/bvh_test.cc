#include "client/synth/bvh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "client/synth/random.h"
#include "client/synth/solid.h"

namespace romap::synth::bvh_test {

TEST(BvhTest, ContainsAgreesWithTheBall) {
  const Mesh ball = Ellipsoid(Point(0.1F, -0.2F, 0.3F), Point::Constant(0.08F));
  const Bvh bvh(ball.vertices, ball.triangles);
  Random random(5);
  for (int i = 0; i < 2000; ++i) {
    const Point p(static_cast<float>(random.Uniform(0.0, 0.2)), static_cast<float>(random.Uniform(-0.3, -0.1)),
                  static_cast<float>(random.Uniform(0.2, 0.4)));
    const float distance_m = (p - Point(0.1F, -0.2F, 0.3F)).norm();
    if (std::abs(distance_m - 0.08F) < 0.001F) continue;  // the mesh is a polyhedron
    ASSERT_EQ(bvh.Contains(p), distance_m < 0.08F) << p.transpose();
  }
}

TEST(BvhTest, OccludedAgreesWithExhaustiveSearch) {
  // Random triangles; the reference computes the intersection with each one.
  Random random(9);
  const auto coordinate = [&](double reach) { return static_cast<float>(random.Uniform(-reach, reach)); };
  std::vector<Point> positions;
  std::vector<std::array<uint32_t, 3>> triangles;
  for (uint32_t i = 0; i < 300; ++i) {
    const Point center(coordinate(1), coordinate(1), coordinate(1));
    for (int k = 0; k < 3; ++k)
      positions.push_back(center + Point(coordinate(0.15), coordinate(0.15), coordinate(0.15)));
    triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const Bvh bvh(positions, triangles);
  int occluded = 0;
  for (int i = 0; i < 1000; ++i) {
    const Point from(coordinate(1.5), coordinate(1.5), coordinate(1.5));
    const Point along = Point(coordinate(1.5), coordinate(1.5), coordinate(1.5)) - from;
    bool expected = false;
    for (const auto& [a, b, c] : triangles) {
      Eigen::Matrix3d edges;
      edges << (positions[b] - positions[a]).cast<double>(), (positions[c] - positions[a]).cast<double>(),
          -along.cast<double>();
      const Eigen::Vector3d uvt = edges.fullPivLu().solve((from - positions[a]).cast<double>());
      expected |= uvt.x() > 0 && uvt.y() > 0 && uvt.x() + uvt.y() < 1 && uvt.z() > 0 && uvt.z() < 1;
    }
    ASSERT_EQ(bvh.Occluded(from, along, 0, 1), expected) << "ray " << i;
    occluded += expected ? 1 : 0;
  }
  EXPECT_GT(occluded, 100);
  EXPECT_LT(occluded, 900);
}

TEST(BvhTest, NearestAgreesWithExhaustiveSearch) {
  Random random(11);
  const auto coordinate = [&](double reach) { return static_cast<float>(random.Uniform(-reach, reach)); };
  std::vector<Point> positions;
  std::vector<std::array<uint32_t, 3>> triangles;
  for (uint32_t i = 0; i < 400; ++i) {
    const Point center(coordinate(1), coordinate(1), coordinate(1));
    for (int k = 0; k < 3; ++k) positions.push_back(center + Point(coordinate(0.2), coordinate(0.2), coordinate(0.2)));
    triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  const Bvh bvh(positions, triangles);
  int hits = 0;
  for (int i = 0; i < 1000; ++i) {
    const Point from(coordinate(1.5), coordinate(1.5), coordinate(1.5));
    const Point along(coordinate(1), coordinate(1), coordinate(1));
    double nearest = std::numeric_limits<double>::infinity();
    uint32_t expected = 0;
    for (uint32_t k = 0; k < triangles.size(); ++k) {
      const Point ab = positions[3 * k + 1] - positions[3 * k];
      const Point ac = positions[3 * k + 2] - positions[3 * k];
      if (along.dot(ab.cross(ac)) >= 0) continue;
      Eigen::Matrix3d edges;
      edges << ab.cast<double>(), ac.cast<double>(), -along.cast<double>();
      const Eigen::Vector3d uvt = edges.fullPivLu().solve((from - positions[3 * k]).cast<double>());
      if (uvt.x() < 0 || uvt.y() < 0 || uvt.x() + uvt.y() > 1 || uvt.z() <= 0 || uvt.z() >= nearest) continue;
      nearest = uvt.z();
      expected = k;
    }
    const auto hit = bvh.Nearest(from, along);
    ASSERT_EQ(hit.has_value(), std::isfinite(nearest)) << "ray " << i;
    if (!hit) continue;
    ++hits;
    EXPECT_EQ(hit->triangle, expected) << "ray " << i;
    EXPECT_NEAR(hit->t, nearest, 1e-4 * nearest + 1e-5);
  }
  EXPECT_GT(hits, 100);
  EXPECT_FALSE(bvh.Nearest(Point::Zero(), Point::Constant(std::numeric_limits<float>::quiet_NaN())).has_value());
}

TEST(BvhTest, AcceptsNoTriangles) {
  const Bvh bvh({}, {});
  EXPECT_FALSE(bvh.Occluded(Point::Zero(), Point::UnitZ(), 0, 1));
  EXPECT_FALSE(bvh.Contains(Point::Zero()));
}

}  // namespace romap::synth::bvh_test
