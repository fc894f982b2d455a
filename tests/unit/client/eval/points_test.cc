#include "client/eval/points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "client/eval/pcg64.h"
#include "common/assignment.h"
#include "tests/unit/client/eval/eval_world.h"

namespace romap::eval {
namespace {

using ::testing::ElementsAre;

// The expected numbers are what NumPy 1.24 prints for the same seeds.
TEST(Pcg64, DrawsTheNumbersOfNumPy) {
  Pcg64 zero(0);
  EXPECT_EQ(zero.Next64(), 0xa30febcfd9c2825fu);
  EXPECT_EQ(zero.Next64(), 0x4510bdf882d9d721u);
  Pcg64 other(12345);
  EXPECT_NEAR(other.NextUniform(), 0.22733602, 1e-8);
  EXPECT_NEAR(other.NextUniform(), 0.31675834, 1e-8);
}

TEST(Pcg64, ChoosesTheSubsetsOfNumPy) {
  Pcg64 random(0);
  const std::vector<uint32_t> first = random.Choose(12000, 3000);
  ASSERT_EQ(first.size(), 3000u);
  EXPECT_EQ(first[0], 11168u);
  EXPECT_EQ(first[1], 10032u);
  EXPECT_EQ(first.back(), 10207u);
  const std::vector<uint32_t> second = random.Choose(20000, 15000);
  EXPECT_EQ(second[0], 7315u);
  EXPECT_EQ(second.back(), 4361u);
  EXPECT_NEAR(random.NextUniform(), 0.48676708914142985, 1e-15);
}

TEST(SampleSurface, SpreadsPointsEvenlyOverTheArea) {
  Mesh mesh = eval_world::Box({1, 2, 3}, {0, 0, 0});
  const auto points = SampleSurface(mesh, 40000, 1, "box");
  ASSERT_TRUE(points.ok());
  int on_x_sides = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : *points) {
    on_x_sides += std::abs(std::abs(p.x()) - 1) < 1e-12;
    mean += p / static_cast<double>(points->size());
  }
  EXPECT_NEAR(on_x_sides / 40000.0, 2 * 24 / 88.0, 0.01) << "24 of 44 per pair of sides";
  EXPECT_LT(mean.norm(), 0.04);
  EXPECT_EQ(*points, *SampleSurface(mesh, 40000, 1, "box"));
  mesh.triangles = {{0, 0, 1}};
  EXPECT_EQ(SampleSurface(mesh, 10, 1, "line").status().message(), "line: the mesh has no area");
  mesh.triangles.clear();
  EXPECT_EQ(SampleSurface(mesh, 10, 1, "cloud")->size(), 8u) << "a cloud is taken whole";
}

TEST(NearestIndex, FindsWhatASearchThroughAllFinds) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto draw = [&](size_t count) {
    Points points(count);
    for (Eigen::Vector3d& p : points) p = {uniform(random), uniform(random), uniform(random)};
    return points;
  };
  const Points points = draw(500), queries = draw(300);
  const Neighbours found = NearestIndex(points).Query(queries);
  for (size_t k = 0; k < queries.size(); ++k) {
    double best = 1e9;
    for (const Eigen::Vector3d& p : points) best = std::min(best, (p - queries[k]).norm());
    EXPECT_NEAR(found.distance[k], best, 1e-12);
    EXPECT_NEAR((points[found.index[k]] - queries[k]).norm(), best, 1e-12);
  }
}

TEST(AssignRows, FindsTheCheapestPairing) {
  Eigen::MatrixXd cost(3, 3);
  cost << 4, 1, 3, 2, 0, 5, 3, 2, 2;
  EXPECT_THAT(AssignRows(cost), ElementsAre(1, 0, 2));
  EXPECT_THAT(AssignRows(cost.topRows(2)), ElementsAre(1, 0));
  Eigen::MatrixXd tall(3, 2);
  tall << 9, 9, 2, 0, 3, 2;
  EXPECT_THAT(AssignRows(tall), ElementsAre(-1, 1, 0)) << "row 0 is left over";
}

TEST(AssignRows, AgreesWithTryingAllPairings) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int round = 0; round < 50; ++round) {
    const Eigen::MatrixXd cost = Eigen::MatrixXd::NullaryExpr(4, 5, [&] { return normal(random); });
    std::vector<int> columns{0, 1, 2, 3, 4};
    double best = 1e9;
    do {
      double sum = 0;
      for (int row = 0; row < 4; ++row) sum += cost(row, columns[row]);
      best = std::min(best, sum);
    } while (std::next_permutation(columns.begin(), columns.end()));
    const std::vector<int> found = AssignRows(cost);
    double sum = 0;
    for (int row = 0; row < 4; ++row) sum += cost(row, found[row]);
    EXPECT_NEAR(sum, best, 1e-12);
    const std::vector<int> turned = AssignRows(cost.transpose());
    for (int row = 0; row < 4; ++row) EXPECT_EQ(turned[found[row]], row);
  }
}

}  // namespace
}  // namespace romap::eval
