#include "server/objects/two_sample_test.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace romap::objects::two_sample_test_test {

using Points = std::vector<Eigen::Vector3d>;

// Reference values: numpy 1.24, scipy 1.10,
//   from scipy import special, stats
//   special.betainc([0.5, 2, 5, 30, 0.5, 100], [0.5, 3, 1.5, 0.5, 60, 3], [0.3, 0.4, 0.9, 0.99, 0.001, 0.95])
//   stats.f.sf(f, d1, d2)
TEST(DistributionTest, AgreesWithScipy) {
  EXPECT_NEAR(IncompleteBeta(0.5, 0.5, 0.3), 0.3690101195655454, 1e-12);
  EXPECT_NEAR(IncompleteBeta(2, 3, 0.4), 0.5247999999999999, 1e-12);
  EXPECT_NEAR(IncompleteBeta(5, 1.5, 0.9), 0.7761721343162157, 1e-12);
  EXPECT_NEAR(IncompleteBeta(30, 0.5, 0.99), 0.439334368905251, 1e-12);
  EXPECT_NEAR(IncompleteBeta(0.5, 60, 0.001), 0.2704887585523264, 1e-12);
  EXPECT_NEAR(IncompleteBeta(100, 3, 0.95), 0.11026985672872092, 1e-12);
  EXPECT_EQ(IncompleteBeta(2, 3, 0), 0);
  EXPECT_EQ(IncompleteBeta(2, 3, 1), 1);
  EXPECT_NEAR(FisherUpperP(2.6, 3, 120.5), 0.05531443490494034, 1e-12);
  EXPECT_NEAR(FisherUpperP(0.3, 3, 17.4), 0.8249403745279581, 1e-12);
}

// The 5 % columns of the printed tables.
TEST(DistributionTest, AgreesWithTables) {
  EXPECT_NEAR(FisherUpperP(4.96, 1, 10), 0.05, 1e-4);
  EXPECT_NEAR(FisherUpperP(3.71, 3, 10), 0.05, 1e-4);
  EXPECT_EQ(FisherUpperP(0, 3, 10), 1);
}

const Points kA = {{0.201, 0.149, 0.018},   {-0.691, -0.227, -0.197}, {0.26, 0.67, -0.048},     {-0.42, 0.245, 0.207},
                   {0.305, -0.465, 0.091},  {0.895, -0.672, -0.037},  {-1.701, -0.645, -0.453}, {-0.035, -0.634, 0.181},
                   {0.357, -0.093, -0.655}, {-0.339, -0.024, 0.134},  {-1.33, -0.239, -0.194},  {-0.609, 0.53, -0.142}};
const Points kB = {{0.874, 0.513, 0.155},  {0.811, -0.045, 0.337}, {-0.08, -0.292, 0.851},
                   {-0.338, 0.192, 0.434}, {0.387, 1.172, 0.805},  {-0.059, -0.288, 0.538},
                   {0.749, 0.34, 0.342},   {1.434, 1.04, 0.174},   {1.063, -0.384, 0.305}};

// numpy, with S1 = cov(A.T) / 12, S2 = cov(B.T) / 9, S = S1 + S2, d the difference of the means, M = S_i inv(S):
//   T2 = d @ solve(S, d);  nu = 12 / sum((trace(M @ M) + trace(M)**2) / (n_i - 1) for both)
//   stats.f.sf(T2 * (nu - 2) / (3 * nu), 3, nu - 2)
TEST(HotellingTest, AgreesWithNumpy) {
  const auto test = HotellingTest(PointMoments::Of(kA), PointMoments::Of(kB), 0.01);
  ASSERT_TRUE(test);
  EXPECT_NEAR(test->statistic, 37.51847766070951, 1e-9);
  EXPECT_NEAR(test->dof, 17.279163675118028, 1e-9);
  EXPECT_NEAR(test->p_value, 0.00041122171744704955, 1e-12);
  EXPECT_FALSE(test->regularized);
}

TEST(HotellingTest, DoesNotDependOnAxesAndUnits) {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(1.1, Eigen::Vector3d(1, 2, -1).normalized()));
  Points a, b;
  for (const Eigen::Vector3d& p : kA) a.push_back(turn * (7 * p) + Eigen::Vector3d(3, 0, -2));
  for (const Eigen::Vector3d& p : kB) b.push_back(turn * (7 * p) + Eigen::Vector3d(3, 0, -2));
  const auto test = HotellingTest(PointMoments::Of(b), PointMoments::Of(a), 0.07);
  ASSERT_TRUE(test);
  EXPECT_NEAR(test->statistic, 37.51847766070951, 1e-8);
  EXPECT_NEAR(test->dof, 17.279163675118028, 1e-8);
}

// Two random sets with the given standard deviations along the axes; those of the second one are rotated.
struct Pair {
  Points a, b;
};
Pair Draw(std::mt19937_64& random, size_t count_a, size_t count_b, const Eigen::Vector3d& spread_a,
          const Eigen::Vector3d& spread_b, const Eigen::Vector3d& shift) {
  std::normal_distribution<double> normal;
  const auto sample = [&](const Eigen::Vector3d& spread) {
    const double x = normal(random), y = normal(random), z = normal(random);
    return Eigen::Vector3d(Eigen::Vector3d(x, y, z).cwiseProduct(spread));
  };
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()));
  Pair pair;
  for (size_t i = 0; i < count_a; ++i) pair.a.push_back(sample(spread_a));
  for (size_t i = 0; i < count_b; ++i) pair.b.push_back(turn * sample(spread_b) + shift);
  return pair;
}

double RejectedShare(size_t count_a, size_t count_b, const Eigen::Vector3d& shift, double tolerance_mu) {
  constexpr int kPairs = 2000;
  std::mt19937_64 random(3);
  int rejected = 0;
  for (int i = 0; i < kPairs; ++i) {
    const Pair pair = Draw(random, count_a, count_b, {1, 0.5, 0.2}, {0.3, 0.6, 0.6}, shift);
    rejected += !MeansAgree(pair.a, pair.b, 0.05, tolerance_mu, 1e-3).value();
  }
  return static_cast<double>(rejected) / kPairs;
}

// 2000 draws of probability 0.05 have a standard deviation of 0.005.
TEST(HotellingTest, RejectsEqualMeansAtTheSignificanceLevel) {
  EXPECT_NEAR(RejectedShare(15, 40, {0, 0, 0}, 0), 0.05, 0.017);
  EXPECT_NEAR(RejectedShare(60, 25, {0, 0, 0}, 0), 0.05, 0.017);
  EXPECT_LT(RejectedShare(6, 30, {0, 0, 0}, 0), 0.09);
}

TEST(HotellingTest, AllowsUnequalCovariances) {
  // With a pooled covariance, the small set with the large spread would be rejected far too often.
  std::mt19937_64 random(4);
  int rejected = 0;
  for (int i = 0; i < 2000; ++i) {
    const Pair pair = Draw(random, 12, 100, {3, 3, 3}, {0.3, 0.3, 0.3}, {0, 0, 0});
    rejected += HotellingTest(PointMoments::Of(pair.a), PointMoments::Of(pair.b), 1e-3)->p_value < 0.05;
  }
  EXPECT_NEAR(rejected / 2000.0, 0.05, 0.017);
}

TEST(MeansAgreeTest, DetectsOnlyShiftsBeyondTheTolerance) {
  const Eigen::Vector3d shift(0.3, 0.3, 0.1);
  EXPECT_GT(RejectedShare(40, 40, shift, 0), 0.8);
  EXPECT_LT(RejectedShare(40, 40, shift, shift.norm()), 0.055) << "the level holds for shifts up to the tolerance";
  EXPECT_GT(RejectedShare(40, 40, 4 * shift, shift.norm()), 0.9);
}

TEST(MeansAgreeTest, ToleranceReducesTheDifferenceWhereItIsLeastSignificant) {
  const PointMoments a = PointMoments::Of(kA), b = PointMoments::Of(kB);
  double before = HotellingTest(a, b, 0.01)->statistic;
  const Eigen::Vector3d d = a.mean - b.mean;
  for (double tolerance = 0.1; tolerance < d.norm(); tolerance += 0.1) {
    const double beyond = HotellingTest(a, b, 0.01, tolerance)->statistic;
    PointMoments nearer = a;
    nearer.mean -= tolerance * d.normalized();
    EXPECT_LE(beyond, HotellingTest(nearer, b, 0.01)->statistic + 1e-9);
    EXPECT_LT(beyond, before);
    before = beyond;
  }
  EXPECT_EQ(HotellingTest(a, b, 0.01, d.norm() + 1e-9)->p_value, 1);
}

TEST(MeansAgreeTest, PointSigmaLimitsTheSignificanceAcrossAPlane) {
  Points low, high;
  for (int i = 0; i < 20; ++i) {
    low.emplace_back(std::sin(i), std::cos(1.7 * i), 0.0);
    high.emplace_back(std::sin(i + 0.3), std::cos(1.7 * i + 0.2), 0.01);
  }
  EXPECT_FALSE(MeansAgree(low, high, 0.05, 0, 0).has_value()) << "singular";
  const auto test = HotellingTest(PointMoments::Of(low), PointMoments::Of(high), 0.03);
  ASSERT_TRUE(test);
  EXPECT_TRUE(test->regularized);
  EXPECT_GT(test->p_value, 0.05) << "0.01 apart, sigma 0.03";
  EXPECT_FALSE(MeansAgree(low, high, 0.05, 0, 0.002).value()) << "0.01 apart, sigma 0.002";
}

TEST(MeansAgreeTest, ReturnsNothingForTooFewOrInvalidPoints) {
  const Points few(kA.begin(), kA.begin() + 4);
  EXPECT_FALSE(MeansAgree(few, kB, 0.05, 0, 0.01).has_value());
  EXPECT_FALSE(MeansAgree(kA, {}, 0.05, 0, 0.01).has_value());
  Points broken = kA;
  broken[3].y() = std::nan("");
  EXPECT_FALSE(MeansAgree(broken, kB, 0.05, 0, 0.01).has_value());
}

}  // namespace romap::objects::two_sample_test_test
