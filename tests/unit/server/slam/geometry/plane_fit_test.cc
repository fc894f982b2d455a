#include "server/slam/geometry/plane_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace romap::slam::plane_fit_test {

const Eigen::Vector3d kUp = Eigen::Vector3d::UnitZ();

TEST(PlaneThrough, ContainsItsThreePoints) {
  const Eigen::Vector3d a(1, 2, 3), b(2, 2, 4), c(0, 5, 1);
  const auto plane = PlaneThrough(a, b, c);
  ASSERT_TRUE(plane.has_value());
  EXPECT_NEAR(plane->normal.norm(), 1, 1e-12);
  for (const Eigen::Vector3d& p : {a, b, c}) EXPECT_NEAR(plane->Height(p), 0, 1e-12);
}

TEST(PlaneThrough, RejectsCollinearPoints) {
  EXPECT_FALSE(PlaneThrough({0, 0, 0}, {1, 1, 1}, {2, 2, 2}).has_value());
  EXPECT_FALSE(PlaneThrough({0, 0, 0}, {0, 0, 0}, {2, 2, 2}).has_value());
  EXPECT_FALSE(PlaneThrough({0, 0, 0}, {1, 0.01, 0}, {2, 0, 0}).has_value());
}

TEST(FitPlane, FindsATiltedPlaneWithItsNormalUp) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 20; ++i) {
    const double x = uniform(random), y = uniform(random);
    points.emplace_back(x, y, 5 + 0.2 * x - 0.3 * y);
  }
  const std::vector<double> weights(points.size(), 3.0);
  const auto fit = FitPlane(points, weights, kUp);
  ASSERT_TRUE(fit.has_value());
  EXPECT_LT((fit->plane.normal - Eigen::Vector3d(-0.2, 0.3, 1).normalized()).norm(), 1e-9);
  EXPECT_NEAR(fit->plane.Height({0, 0, 5}), 0, 1e-9);
  EXPECT_LT(fit->sigma_rad, 1e-9);
  const auto from_below = FitPlane(points, weights, -kUp);
  ASSERT_TRUE(from_below.has_value());
  EXPECT_LT((from_below->plane.normal + fit->plane.normal).norm(), 1e-12);
}

TEST(FitPlane, IgnoresPointsWithoutWeight) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.5, 0.5, 9}};
  const std::vector<double> weights = {1, 1, 1, 1, 0};
  const auto fit = FitPlane(points, weights, kUp);
  ASSERT_TRUE(fit.has_value());
  EXPECT_LT((fit->plane.normal - kUp).norm(), 1e-12);
  EXPECT_FALSE(FitPlane(points, std::vector<double>{1, 1, 1, 0, 0}, kUp).has_value());
}

TEST(FitPlane, RejectsCollinearPoints) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {1, 1, 0}, {2, 2, 0}, {3, 3, 0}, {4, 4, 0}};
  EXPECT_FALSE(FitPlane(points, std::vector<double>(5, 1.0), kUp).has_value());
}

// sigma_rad must match the actual scatter of the normal, even if the weights are unrelated to accuracy.
TEST(FitPlane, SigmaMatchesTheScatterOfTheNormal) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0, 1);
  double squared_error = 0;
  double squared_sigma = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<Eigen::Vector3d> points;
    std::vector<double> weights;
    for (int i = 0; i < 80; ++i) {
      points.emplace_back(4 * uniform(random), uniform(random), 0.01 * normal(random));
      weights.push_back(0.1 + uniform(random));
    }
    const auto fit = FitPlane(points, weights, kUp);
    ASSERT_TRUE(fit.has_value());
    squared_error += std::pow(std::acos(fit->plane.normal.z()), 2);
    squared_sigma += std::pow(fit->sigma_rad, 2);
  }
  EXPECT_NEAR(std::sqrt(squared_sigma / squared_error), 1, 0.12);
}

}  // namespace romap::slam::plane_fit_test
