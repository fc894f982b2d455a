#include "server/objects/footprint.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

namespace romap::objects::footprint_test {

constexpr double kCell = 0.01;

// Centers of the cells of a regular grid inside a rotated rectangle.
std::vector<Eigen::Vector3d> FillRectangle(double yaw_rad, const Eigen::Vector2d& half_extents) {
  const Eigen::Rotation2Dd to_rectangle(-yaw_rad);
  std::vector<Eigen::Vector3d> cells;
  for (int x = -60; x <= 60; ++x) {
    for (int y = -60; y <= 60; ++y) {
      const Eigen::Vector2d p = kCell * Eigen::Vector2d(x, y);
      const Eigen::Vector2d inside = (to_rectangle * p).cwiseAbs();
      if ((inside.array() <= half_extents.array()).all()) cells.emplace_back(p.x(), p.y(), 0);
    }
  }
  return cells;
}

std::optional<Footprint> Fit(const std::vector<Eigen::Vector3d>& cells, std::optional<double> previous_yaw_rad,
                             std::optional<double> edge_yaw_rad) {
  return FitFootprint(cells, Eigen::Vector3d::Constant(kCell), previous_yaw_rad, edge_yaw_rad);
}

TEST(FootprintTest, FindsTheSmallestRectangle) {
  const auto footprint = Fit(FillRectangle(0.4, {0.4, 0.2}), {}, {});
  ASSERT_TRUE(footprint.has_value());
  EXPECT_NEAR(footprint->yaw_rad, 0.4, 0.04);
  EXPECT_NEAR(footprint->half_extents.x(), 0.4, 0.02);
  EXPECT_NEAR(footprint->half_extents.y(), 0.2, 0.02);
}

TEST(FootprintTest, HasTheEdgeYawNearestToThePreviousYaw) {
  const std::vector<Eigen::Vector3d> cells = FillRectangle(0.4, {0.4, 0.2});
  const double edge_yaw_rad = 0.45;
  const auto first = Fit(cells, {}, edge_yaw_rad);
  ASSERT_TRUE(first.has_value());
  EXPECT_NEAR(first->yaw_rad, edge_yaw_rad, 1e-9);
  const auto next = Fit(cells, 0.4 + std::numbers::pi / 2, edge_yaw_rad);
  ASSERT_TRUE(next.has_value());
  EXPECT_NEAR(next->yaw_rad, edge_yaw_rad + std::numbers::pi / 2, 1e-9);
  EXPECT_NEAR(next->half_extents.x(), first->half_extents.y(), 1e-9);
  EXPECT_NEAR(next->half_extents.y(), first->half_extents.x(), 1e-9);
}

TEST(FootprintTest, EdgesDecideTheYawOfARoundFootprint) {
  const std::vector<Eigen::Vector3d> square = FillRectangle(0, {0.3, 0.3});
  std::vector<Eigen::Vector3d> disc;
  for (const Eigen::Vector3d& cell : square) {
    if (cell.norm() <= 0.3) disc.push_back(cell);
  }
  const auto kept = Fit(disc, 0.2, {});
  const auto turned = Fit(disc, 0.2, 0.7);
  ASSERT_TRUE(kept && turned);
  EXPECT_NEAR(kept->yaw_rad, 0.2, 1e-9);
  EXPECT_NEAR(turned->yaw_rad, 0.7, 1e-9);
}

TEST(FootprintTest, IgnoresEdgesThatMakeTheRectangleMuchLarger) {
  const auto footprint = Fit(FillRectangle(0.1, {0.5, 0.1}), {}, 0.1 + std::numbers::pi / 4);
  ASSERT_TRUE(footprint.has_value());
  EXPECT_NEAR(footprint->yaw_rad, 0.1, 0.04);
}

TEST(FootprintTest, ReturnsNothingForThreeCells) {
  EXPECT_FALSE(Fit({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {}, 0.3).has_value());
}

}  // namespace romap::objects::footprint_test
