#include "server/slam/geometry/support_plane.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <ostream>
#include <string>

#include "common/angles.h"
#include "tests/unit/server/slam/geometry/support_world.h"

namespace romap::slam::support_plane_test {

struct WorldCase {
  std::string name;
  SupportWorld::Options options;
  friend void PrintTo(const WorldCase& world_case, std::ostream* os) { *os << world_case.name; }
};

class SupportPlaneInWorlds : public ::testing::TestWithParam<WorldCase> {};

TEST_P(SupportPlaneInWorlds, FindsTheTable) {
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    SupportWorld::Options options = GetParam().options;
    options.seed = seed;
    const SupportWorld world(options);
    const auto plane = FindSupportPlane(world.Query());
    ASSERT_TRUE(plane.has_value());
    EXPECT_LT(world.TiltError_rad(*plane), 0.5 * kRadPerDeg);
    EXPECT_LT(world.HeightError_m(*plane), 0.01);
    EXPECT_LT(world.TiltError_rad(*plane), 4 * plane->sigma_rad);
    EXPECT_LT(plane->sigma_rad, 1 * kRadPerDeg);
    EXPECT_GT(plane->confidence, 0.5);
    EXPECT_LE(plane->confidence, 1);
    EXPECT_NEAR(plane->normal_world.norm(), 1, 1e-9);
    EXPECT_GE(plane->inliers, options.table_points / 4);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Worlds, SupportPlaneInWorlds,
    ::testing::Values(WorldCase{"Plain", {}}, WorldCase{"FewPoints", {.table_points = 150}},
                      WorldCase{"SigmasTooSmall", {.sigma_factor = 0}},
                      WorldCase{"SigmasTooLarge", {.sigma_factor = 4}},
                      WorldCase{"FloorVisibleBesideTheTable", {.table_points = 60, .floor_points = 1000}},
                      WorldCase{"FloorVisibleAndObjectBottomsHidden", {.object_bottom = 0.4, .floor_points = 500}},
                      WorldCase{"WallBehind", {.wall_points = 1000}},
                      WorldCase{"WallBehindSteepView", {.wall_points = 500, .elevation_rad = 60 * kRadPerDeg}},
                      WorldCase{"ClutterOnTheTable", {.clutter_points = 200}},
                      WorldCase{"HalfOfTheTablePointsAreOutliers", {.outlier_share = 0.5}},
                      WorldCase{"GrazingView", {.elevation_rad = 12 * kRadPerDeg}},
                      WorldCase{"Everything",
                                {.table_points = 250,
                                 .floor_points = 500,
                                 .wall_points = 500,
                                 .clutter_points = 100,
                                 .outlier_share = 0.2}}),
    [](const auto& info) { return info.param.name; });

TEST(SupportPlane, SigmaGrowsWithTheNoiseAndBoundsTheError) {
  double sigma_before_rad = 0;
  for (const double noise : {0.002, 0.01, 0.02}) {
    SCOPED_TRACE(noise);
    double squared_error = 0;
    double squared_sigma = 0;
    for (uint64_t seed = 1; seed <= 20; ++seed) {
      const SupportWorld world({.table_points = 150, .depth_noise = noise, .seed = seed});
      const auto plane = FindSupportPlane(world.Query());
      ASSERT_TRUE(plane.has_value());
      squared_error += std::pow(world.TiltError_rad(*plane), 2);
      squared_sigma += std::pow(plane->sigma_rad, 2);
    }
    EXPECT_LT(std::sqrt(squared_error), 2 * std::sqrt(squared_sigma));
    EXPECT_GT(std::sqrt(squared_sigma), 1.03 * sigma_before_rad);
    sigma_before_rad = std::sqrt(squared_sigma);
  }
}

// A plane that cannot support the objects is rejected, regardless of the number of its points.
TEST(SupportPlane, RejectsADistantFloorAndAWall) {
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    const SupportWorld floor({.table_points = 0, .floor_points = 800, .seed = seed});
    EXPECT_FALSE(FindSupportPlane(floor.Query()).has_value());
    const SupportWorld wall({.table_points = 0, .wall_points = 800, .seed = seed});
    EXPECT_FALSE(FindSupportPlane(wall.Query()).has_value());
  }
}

TEST(SupportPlane, HasLowConfidenceWithoutAPlane) {
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    const auto plane = FindSupportPlane(SupportWorld({.outlier_share = 1, .seed = seed}).Query());
    EXPECT_LT(plane ? plane->confidence : 0, 0.2);
  }
}

TEST(SupportPlane, RejectsCollinearPoints) {
  SupportWorld world({});
  const Eigen::Vector3d start = world.points[0].position_world;
  const Eigen::Vector3d along = world.points[1].position_world - start;
  for (size_t i = 0; i < world.points.size(); ++i) world.points[i].position_world = start + 0.01 * i * along;
  EXPECT_FALSE(FindSupportPlane(world.Query()).has_value());
}

TEST(SupportPlane, RequiresPointsObjectsAndCameras) {
  const SupportWorld world({});
  EXPECT_FALSE(FindSupportPlane({}).has_value());
  SupportPlaneQuery query = world.Query();
  query.points = query.points.first(11);
  EXPECT_FALSE(FindSupportPlane(query).has_value());
  query = world.Query();
  query.object_points_world = {};
  EXPECT_FALSE(FindSupportPlane(query).has_value());
  query = world.Query();
  query.camera_centers_world = {};
  EXPECT_FALSE(FindSupportPlane(query).has_value());
  query = world.Query();
  query.camera_ups_world = {};
  EXPECT_FALSE(FindSupportPlane(query).has_value());
}

TEST(SupportPlane, IgnoresPointsThatAreNotFinite) {
  SupportWorld world({});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (size_t i = 0; i < world.points.size(); i += 5) {
    world.points[i].position_world = Eigen::Vector3d::Constant(i % 2 == 0 ? nan : HUGE_VAL);
  }
  world.points[1].sigma_mu = nan;
  world.object_points[0].x() = nan;
  world.camera_centers[0].x() = nan;
  world.camera_ups[0].x() = nan;
  const auto plane = FindSupportPlane(world.Query());
  ASSERT_TRUE(plane.has_value());
  EXPECT_LT(world.TiltError_rad(*plane), 0.5 * kRadPerDeg);
}

TEST(SupportPlane, IsDeterministicForASeedAndSimilarForAnother) {
  const SupportWorld world({.clutter_points = 100, .outlier_share = 0.3});
  const auto first = FindSupportPlane(world.Query(5));
  const auto again = FindSupportPlane(world.Query(5));
  const auto other = FindSupportPlane(world.Query(6));
  ASSERT_TRUE(first && again && other);
  EXPECT_EQ(first->normal_world, again->normal_world);
  EXPECT_EQ(first->confidence, again->confidence);
  EXPECT_GT(first->normal_world.dot(other->normal_world), std::cos(0.3 * kRadPerDeg));
}

}  // namespace romap::slam::support_plane_test
