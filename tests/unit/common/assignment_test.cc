#include "common/assignment.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <random>

namespace romap::assignment_test {

using ::testing::ElementsAre;

TEST(AssignRowsTest, FindsTheCheapestAssignment) {
  Eigen::MatrixXd cost(3, 3);
  cost << 4, 1, 3, 2, 0, 5, 3, 2, 2;
  EXPECT_THAT(AssignRows(cost), ElementsAre(1, 0, 2));
  EXPECT_THAT(AssignRows(cost.topRows(2)), ElementsAre(1, 0));
  Eigen::MatrixXd tall(3, 2);
  tall << 9, 9, 2, 0, 3, 2;
  EXPECT_THAT(AssignRows(tall), ElementsAre(-1, 1, 0)) << "row 0 is not assigned";
}

TEST(AssignRowsTest, AgreesWithExhaustiveSearch) {
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

}  // namespace romap::assignment_test
