#include "server/objects/isolation_forest.h"

#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace romap::objects {
namespace {

constexpr float kEndless = std::numeric_limits<float>::infinity();

// Points of the surface of a box with sides 2, 1 and 0.6, and behind them `outliers` in a shell around it.
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

// Chance that an outlier scores above an inlier; the outliers are the last ones.
double AreaUnderCurve(const std::vector<double>& scores, size_t inliers) {
  double wins = 0;
  for (size_t o = inliers; o < scores.size(); ++o) {
    for (size_t i = 0; i < inliers; ++i) wins += scores[o] > scores[i] ? 1 : scores[o] == scores[i] ? 0.5 : 0;
  }
  return wins / static_cast<double>(inliers * (scores.size() - inliers));
}

TEST(IsolationForestTest, MeanPathLengthIsThatOfTheFormula) {
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

// One tree: x < 0 is a leaf of depth 1 that holds one point; else y < 2 parts a leaf with four points from one.
TEST(IsolationForestTest, ScoresFollowFromThePathsOfATree) {
  const auto leaf = [](uint32_t self, double length) {
    return IsolationForest::Node{.offset = kEndless, .child = self, .path_length = static_cast<float>(length)};
  };
  std::vector<IsolationForest::Node> nodes(5);
  nodes[0] = {.normal = {1, 0, 0}, .offset = 0, .child = 1};
  nodes[1] = leaf(1, 1);
  nodes[2] = {.normal = {0, 1, 0}, .offset = 2, .child = 3};
  nodes[3] = leaf(3, 2 + MeanPathLength(4));
  nodes[4] = leaf(4, 2);
  const std::vector<Eigen::Vector3d> points = {{-1, 0, 0}, {1, 0, 0}, {1, 3, 0}};
  const IsolationForest tree(nodes, {0}, 2, 6);
  const std::vector<double> scores = tree.Scores(points);
  const double c = MeanPathLength(6);
  EXPECT_NEAR(scores[0], std::exp2(-1 / c), 1e-6);
  EXPECT_NEAR(scores[1], std::exp2(-(2 + MeanPathLength(4)) / c), 1e-6);
  EXPECT_NEAR(scores[2], std::exp2(-2 / c), 1e-6);
  // A second tree of one leaf: paths are averaged, not scores.
  nodes.push_back(leaf(5, 3));
  EXPECT_NEAR(IsolationForest(nodes, {0, 5}, 2, 6).Scores(points)[0], std::exp2(-2 / c), 1e-6);
}

TEST(IsolationForestTest, FindsPlantedOutliersBetterThanDistanceFromTheMean) {
  double forest_sum = 0, distance_sum = 0;
  constexpr int kSets = 10;
  for (int set = 0; set < kSets; ++set) {
    const std::vector<Eigen::Vector3d> points = BoxWithOutliers(150, 15, static_cast<uint64_t>(set));
    const std::vector<double> scores = IsolationScores(points, {});
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

TEST(IsolationForestTest, TheThresholdPartsPlantedOutliers) {
  int kept = 0, found = 0;
  constexpr int kSets = 10;
  for (int set = 0; set < kSets; ++set) {
    const std::vector<double> scores = IsolationScores(BoxWithOutliers(150, 8, 100 + static_cast<uint64_t>(set)), {});
    kept += static_cast<int>(
        std::count_if(scores.begin(), scores.begin() + 150, [](double score) { return score <= kAnomalyScore; }));
    found += static_cast<int>(
        std::count_if(scores.begin() + 150, scores.end(), [](double score) { return score > kAnomalyScore; }));
  }
  EXPECT_GT(kept, 0.97 * kSets * 150);
  EXPECT_GT(found, 0.7 * kSets * 8);
}

// Hariri's example: two clusters on a diagonal. Cuts across the axes leave ghosts of them on the other diagonal.
TEST(IsolationForestTest, SlopingCutsLeaveNoGhosts) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0, 0.5);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 400; ++i) {
    const double side = i % 2 == 0 ? -5 : 5;
    const double x = normal(random), y = normal(random), z = normal(random);
    points.emplace_back(side + x, side + y, z);
  }
  const std::vector<Eigen::Vector3d> ghosts = {{-5, 5, 0}, {5, -5, 0}};
  const auto ghost_score = [&](int level) {
    const IsolationForest forest(points, {.trees = 300, .sample_size = 256, .extension_level = level});
    const std::vector<double> scores = forest.Scores(ghosts);
    return 0.5 * (scores[0] + scores[1]);
  };
  EXPECT_GT(ghost_score(2), ghost_score(0) + 0.02);
  EXPECT_GT(ghost_score(2), kAnomalyScore);
}

TEST(IsolationForestTest, PlaceAndUnitOfTheMapDoNotMatter) {
  const std::vector<Eigen::Vector3d> points = BoxWithOutliers(100, 5, 1);
  std::vector<Eigen::Vector3d> elsewhere;
  for (const Eigen::Vector3d& p : points) elsewhere.push_back(1e-3 * p + Eigen::Vector3d(40, -70, 3));
  const std::vector<double> scores = IsolationScores(points, {}), others = IsolationScores(elsewhere, {});
  for (size_t i = 0; i < points.size(); ++i) EXPECT_NEAR(scores[i], others[i], 0.01) << i;
}

TEST(IsolationForestTest, EqualInputGivesEqualScoresOnAnyNumberOfThreads) {
  const std::vector<Eigen::Vector3d> points = BoxWithOutliers(5000, 50, 2);  // enough for several threads
  const auto scores = [&](size_t threads) {
    const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism, threads);
    return IsolationScores(points, {.trees = 200, .sample_size = 256});
  };
  const std::vector<double> one = scores(1);
  EXPECT_EQ(one, scores(4));
  EXPECT_NE(one, IsolationScores(points, {.trees = 200, .sample_size = 256, .seed = 2}));
}

TEST(IsolationForestTest, FewOrEqualPointsAreNoAnomalies) {
  EXPECT_TRUE(IsolationScores({}, {}).empty());
  const std::vector<Eigen::Vector3d> three = {{0, 0, 0}, {1, 0, 0}, {99, 0, 0}};
  EXPECT_EQ(IsolationScores(three, {}), std::vector<double>(3, 0.5));
  const std::vector<Eigen::Vector3d> equal(20, Eigen::Vector3d(1, 2, 3));
  for (const double score : IsolationScores(equal, {})) EXPECT_NEAR(score, 0.5, 1e-6);
}

}  // namespace
}  // namespace romap::objects
