#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace romap::objects {

// Tests whether two sets of sparse points have the same mean, to decide whether they may be from one object. The tests
// do not assume equal covariances, because points from different view directions scatter differently.
//
// A rejection means that the sets are farther apart than their scatter explains. Limits: (1) The tests cannot show that
// two sets are of one object. "Not rejected" with ten points each means that the means differ by less than about one
// standard deviation; the means of two objects at the same position (a bowl and the apple in it) are equal. (2) They do
// not measure the difference. With many points any difference is significant, and the mean points of one object from
// two directions do differ, by up to half the object's size. MeansAgree() allows for that. (3) They assume independent
// points. Neighboring features of one image share its pose error, so p-values are too small rather than too large.

// Count, mean and unbiased covariance of points, map units. The covariance of fewer than two points is 0.
struct PointMoments {
  int count = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();

  static PointMoments Of(std::span<const Eigen::Vector3d> points);
};

struct MeanTest {
  double statistic = 0;      // Hotelling's T^2
  double dof = 0;            // nu, see HotellingTest
  double p_value = 1;        // probability of a difference at least this large if the means are equal
  bool regularized = false;  // an eigenvalue of a covariance was raised
};

// Smallest set for HotellingTest: p + 2 points for p = 3 dimensions.
inline constexpr int kMinTestPoints = 5;

// Regularized incomplete beta function I_x(a, b) for a, b > 0 and 0 <= x <= 1.
double IncompleteBeta(double a, double b, double x);
// P(F >= f) of Fisher's F with (d1, d2) > 0 degrees of freedom: I_{d2 / (d2 + d1 f)}(d2 / 2, d1 / 2).
double FisherUpperP(double f, double d1, double d2);

// Test of the mean positions of two sets of points: T^2 = d^T (A / n_a + B / n_b)^-1 d for the difference d of the
// means and the covariances A and B. Under equal means T^2 (nu - p + 1) / (nu p) has approximately the distribution
// F(p, nu - p + 1), p = 3, with nu from K. Krishnamoorthy, J. Yu, "Modified Nel and Van der Merwe test for the
// multivariate Behrens-Fisher problem", Statistics & Probability Letters 66, 2004. It satisfies
// min(n_a, n_b) - 1 <= nu <= n_a + n_b - 2 and does not depend on the choice of axes.
//
// `point_sigma_mu` > 0 is the standard deviation of a single point. The covariance of points on a plane or a line is
// singular, and any shift across it would be infinitely significant. So eigenvalues of a covariance are raised to
// point_sigma_mu^2 (see MeanTest::regularized), which does not change sets that scatter more.
//
// nullopt for fewer than kMinTestPoints points in a set, for values that are not finite, or for a covariance that stays
// singular because `point_sigma_mu` is 0.
//
// `min_shift_mu` is a tolerance: the test is whether the means may be within this distance of each other. T^2 is then
// the smallest value over all ways of reducing the difference by a vector of at most this length. Means that are within
// the tolerance are rejected with at most the probability of the p-value.
std::optional<MeanTest> HotellingTest(const PointMoments& a, const PointMoments& b, double point_sigma_mu,
                                      double min_shift_mu = 0);

// Whether `a` and `b` may be points of one object: their means do not differ significantly (level `alpha`) by more than
// `min_shift_mu`. For one object observed from two directions this should be a share of its size: a quarter for
// directions 60 degrees apart, half for opposite ones. nullopt when there are too few points (see HotellingTest); the
// caller must then use other evidence.
std::optional<bool> MeansAgree(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b, double alpha,
                               double min_shift_mu, double point_sigma_mu);

}  // namespace romap::objects
