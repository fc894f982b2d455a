#include "server/objects/isolation_forest.h"

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/support/sanitizer.h"

namespace romap::objects::isolation_forest_test {

using testing_support::kUnderSanitizer;

constexpr double kThreshold = 0.6;  // a score above it is an anomaly

// `count` points on the surface of a box with sides 2, 1 and 0.6, then `outliers` in a shell around it.
std::vector<Eigen::Vector3d> BoxWithOutliers(int count, int outliers, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const Eigen::Vector3d half(1, 0.5, 0.3);
  std::vector<Eigen::Vector3d> points;
  const auto in_cube = [&] {
    const double x = uniform(random), y = uniform(random), z = uniform(random);
    return Eigen::Vector3d(x, y, z);
  };
  while (static_cast<int>(points.size()) < count) {
    Eigen::Vector3d p = in_cube();
    const int axis = static_cast<int>(points.size() % 3);
    p[axis] = p[axis] < 0 ? -1 : 1;
    points.push_back(p.cwiseProduct(half));
  }
  while (static_cast<int>(points.size()) < count + outliers) {
    const Eigen::Vector3d p = 2.5 * in_cube();
    if ((p.cwiseAbs() - half).maxCoeff() > 0.6) points.push_back(p);
  }
  return points;
}

std::vector<double> Scores(const std::vector<Eigen::Vector3d>& points, const IsolationForestOptions& options = {}) {
  return IsolationForest(points, options).Scores(points);
}

// Probability that an outlier scores above an inlier. The outliers are the last points.
double AreaUnderCurve(const std::vector<double>& scores, size_t inliers) {
  double wins = 0;
  for (size_t o = inliers; o < scores.size(); ++o) {
    for (size_t i = 0; i < inliers; ++i) wins += scores[o] > scores[i] ? 1 : scores[o] == scores[i] ? 0.5 : 0;
  }
  return wins / static_cast<double>(inliers * (scores.size() - inliers));
}

TEST(IsolationForestTest, MeanPathLengthAgreesWithTheFormula) {
  EXPECT_EQ(MeanPathLength(0), 0);
  EXPECT_EQ(MeanPathLength(1), 0);
  EXPECT_EQ(MeanPathLength(2), 1);
  // 2 (ln 255 + 0.5772156649) - 2 * 255 / 256, and the exact mean 2 H(n - 1) - 2 (n - 1) / n.
  EXPECT_NEAR(MeanPathLength(256), 10.244770920, 1e-8);
  for (const size_t n : {20, 64, 500}) {
    double harmonic = 0;
    for (size_t i = 1; i < n; ++i) harmonic += 1.0 / static_cast<double>(i);
    EXPECT_NEAR(MeanPathLength(n), 2 * harmonic - 2 * (1 - 1.0 / static_cast<double>(n)), 1.1 / static_cast<double>(n));
  }
}

// Any cut between two points on an axis isolates both: path length 1, and c(2) = 1.
TEST(IsolationForestTest, ScoresOfTwoPointsFollowFromTheFormula) {
  const std::vector<Eigen::Vector3d> points = {{-1, 0, 0}, {1, 0, 0}};
  for (const double score : Scores(points)) EXPECT_NEAR(score, 0.5, 1e-6);
}

// Nearly every tree isolates the distant point with its first cut, and the other two with the second one.
TEST(IsolationForestTest, ThePointThatIsIsolatedFirstScoresHighest) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {0.1, 0, 0}, {50, 0, 0}};
  const std::vector<double> scores = Scores(points, {.trees = 200});
  EXPECT_NEAR(scores[2], std::exp2(-1 / MeanPathLength(3)), 0.02);
  EXPECT_NEAR(scores[0], std::exp2(-2 / MeanPathLength(3)), 0.02);
  EXPECT_NEAR(scores[1], scores[0], 0.02);
}

TEST(IsolationForestTest, FindsOutliersBetterThanDistanceFromTheMean) {
  double forest_sum = 0, distance_sum = 0;
  constexpr int kSets = 10;
  for (int set = 0; set < kSets; ++set) {
    const std::vector<Eigen::Vector3d> points = BoxWithOutliers(150, 15, static_cast<uint64_t>(set));
    const std::vector<double> scores = Scores(points);
    Eigen::Vector3d mean(0, 0, 0);
    for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
    std::vector<double> distances;
    for (const Eigen::Vector3d& p : points) distances.push_back((p - mean).norm());
    forest_sum += AreaUnderCurve(scores, 150);
    distance_sum += AreaUnderCurve(distances, 150);
  }
  EXPECT_GT(forest_sum / kSets, 0.985);
  EXPECT_GT(forest_sum, distance_sum);
}

TEST(IsolationForestTest, TheThresholdSeparatesOutliers) {
  int kept = 0, found = 0;
  constexpr int kSets = 10;
  for (int set = 0; set < kSets; ++set) {
    const std::vector<double> scores = Scores(BoxWithOutliers(150, 8, 100 + static_cast<uint64_t>(set)));
    kept += static_cast<int>(
        std::count_if(scores.begin(), scores.begin() + 150, [](double score) { return score <= kThreshold; }));
    found += static_cast<int>(
        std::count_if(scores.begin() + 150, scores.end(), [](double score) { return score > kThreshold; }));
  }
  EXPECT_GT(kept, 0.97 * kSets * 150);
  EXPECT_GT(found, 0.7 * kSets * 8);
}

// Example of Hariri et al.: two clusters on a diagonal. Axis-aligned cuts give low scores to the empty regions on the
// other diagonal.
TEST(IsolationForestTest, ObliqueCutsFindAnomaliesBesideDiagonalClusters) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 0.5);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 400; ++i) {
    const double side = i % 2 == 0 ? -5 : 5;
    const double x = normal(random), y = normal(random), z = normal(random);
    points.emplace_back(side + x, side + y, z);
  }
  const std::vector<Eigen::Vector3d> empty_regions = {{-5, 5, 0}, {5, -5, 0}};
  const auto empty_score = [&](int level) {
    const IsolationForest forest(points, {.trees = 300, .sample_size = 256, .extension_level = level});
    const std::vector<double> scores = forest.Scores(empty_regions);
    return 0.5 * (scores[0] + scores[1]);
  };
  EXPECT_GT(empty_score(2), empty_score(0) + 0.02);
  EXPECT_GT(empty_score(2), kThreshold);
}

TEST(IsolationForestTest, IsInvariantToTranslationAndScale) {
  const std::vector<Eigen::Vector3d> points = BoxWithOutliers(100, 5, 1);
  std::vector<Eigen::Vector3d> elsewhere;
  for (const Eigen::Vector3d& p : points) elsewhere.push_back(1e-3 * p + Eigen::Vector3d(40, -70, 3));
  const std::vector<double> scores = Scores(points), others = Scores(elsewhere);
  for (size_t i = 0; i < points.size(); ++i) EXPECT_NEAR(scores[i], others[i], 0.01) << i;
}

TEST(IsolationForestTest, ScoresDoNotDependOnTheNumberOfThreads) {
  // The work must exceed the minimum for several threads. Sanitizers make each step much slower.
  const std::vector<Eigen::Vector3d> points = BoxWithOutliers(kUnderSanitizer ? 1500 : 5000, 50, 2);
  const int trees = kUnderSanitizer ? 100 : 200;
  const auto scores = [&](size_t threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    return Scores(points, {.trees = trees, .sample_size = 256});
  };
  const std::vector<double> one = scores(1);
  EXPECT_EQ(one, scores(4));
  EXPECT_NE(one, Scores(points, {.trees = trees, .sample_size = 256, .seed = 2}));
}

TEST(IsolationForestTest, EqualPointsAreNotAnomalies) {
  EXPECT_TRUE(Scores({}).empty());
  EXPECT_EQ(Scores({{1, 2, 3}}), std::vector<double>(1, 0.5));
  const std::vector<Eigen::Vector3d> equal(20, Eigen::Vector3d(1, 2, 3));
  for (const double score : Scores(equal)) EXPECT_NEAR(score, 0.5, 1e-6);
}

}  // namespace romap::objects::isolation_forest_test
