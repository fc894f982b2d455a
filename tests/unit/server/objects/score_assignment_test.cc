#include "server/objects/score_assignment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace romap::objects::score_assignment_test {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(AssignByScore, MaximizesTheSumNotTheBestPair) {
  Eigen::MatrixXd scores(2, 2);
  scores << 0.9, 0.8,  //
      0.8, 0.1;
  EXPECT_THAT(AssignByScore(scores, 0.05), ElementsAre(1, 0));
}

TEST(AssignByScore, LeavesPairsBelowTheMinimumScoreUnassigned) {
  Eigen::MatrixXd scores(3, 2);
  scores << 0.1, 0.2,  //
      0.9, 0.29,       //
      0.3, 0.0;
  EXPECT_THAT(AssignByScore(scores, 0.3), ElementsAre(-1, 0, -1));
}

TEST(AssignByScore, AcceptsEmptyMatrices) {
  EXPECT_THAT(AssignByScore(Eigen::MatrixXd(0, 3), 0.1), IsEmpty());
  EXPECT_THAT(AssignByScore(Eigen::MatrixXd(2, 0), 0.1), ElementsAre(-1, -1));
}

TEST(AssignByScore, EqualsExhaustiveSearch) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (int round = 0; round < 50; ++round) {
    Eigen::MatrixXd scores(5, 5);
    for (Eigen::Index i = 0; i < scores.size(); ++i) scores(i) = uniform(random);
    // In every second round most pairs are impossible, so that the problem has several components.
    const double min_score = round % 2 == 0 ? 0 : 0.7;
    const auto counted = [&](double score) { return score >= min_score ? score : 0; };
    std::vector<int> order(5);
    std::iota(order.begin(), order.end(), 0);
    double best = 0;
    do {
      double sum = 0;
      for (int i = 0; i < 5; ++i) sum += counted(scores(i, order[static_cast<size_t>(i)]));
      best = std::max(best, sum);
    } while (std::next_permutation(order.begin(), order.end()));
    const std::vector<int> columns = AssignByScore(scores, min_score);
    double sum = 0;
    for (int i = 0; i < 5; ++i) {
      if (columns[static_cast<size_t>(i)] >= 0) sum += scores(i, columns[static_cast<size_t>(i)]);
    }
    EXPECT_NEAR(sum, best, 1e-12);
  }
}

}  // namespace romap::objects::score_assignment_test
