#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace romap::objects {

// Are two sets of sparse points from the same object? Tests of equal means that do not suppose equal covariances,
// because two looks at a thing scatter differently.
//
// What these tests can tell: that two sets lie apart by more than their scatter explains. What they cannot: (1) That
// sets are of one thing. "Not rejected" with ten points each only says that the means differ by less than about one
// spread; of two things in one place, a bowl and the apple in it, the means are equal. (2) How big a difference is:
// with many points any difference is significant, and points of one thing seen from two sides do differ in mean, by up
// to half the thing's size. SamePlace() allows for that. (3) They take points for independent draws. Neighbouring
// features of one picture share its pose error, so p-values are too small rather than too large.

// Count, mean and unbiased covariance of points, map units. The covariance of fewer than two points is 0.
struct PointMoments {
  int count = 0;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();

  static PointMoments Of(std::span<const Eigen::Vector3d> points);
};

struct MeanTest {
  double statistic = 0;      // t, or Hotelling's T^2
  double dof = 0;            // nu: of t's distribution, or of T^2's (see HotellingTest)
  double p_value = 1;        // of means that differ so much or more if they were the same
  bool regularised = false;  // a covariance had to be widened
};

// Fewest points of a set for HotellingTest: p + 2 for p = 3 dimensions.
inline constexpr int kFewestPoints = 5;

// Regularised incomplete beta function I_x(a, b) for a, b > 0 and 0 <= x <= 1.
double IncompleteBeta(double a, double b, double x);
// P(|T| >= |t|) of Student's t with `dof` > 0 degrees of freedom: I_{dof / (dof + t^2)}(dof / 2, 1 / 2).
double StudentTwoSidedP(double t, double dof);
// P(F >= f) of Fisher's F with (d1, d2) > 0 degrees of freedom: I_{d2 / (d2 + d1 f)}(d2 / 2, d1 / 2).
double FisherUpperP(double f, double d1, double d2);

// Two numbers' means, two-sided (B. L. Welch, "The generalization of 'Student's' problem when several different
// population variances are involved", 1947), with Satterthwaite's degrees of freedom. Nothing for fewer than two values
// on a side, or when neither side varies.
std::optional<MeanTest> WelchTest(std::span<const double> a, std::span<const double> b);

// Two points' means: T^2 = d^T (A / n_a + B / n_b)^-1 d for the difference d of the means and the covariances A and B.
// Under equal means T^2 (nu - p + 1) / (nu p) is about F(p, nu - p + 1)-distributed, p = 3, with the nu of K.
// Krishnamoorthy, J. Yu, "Modified Nel and Van der Merwe test for the multivariate Behrens-Fisher problem", Statistics
// & Probability Letters 66, 2004, which min(n_a, n_b) - 1 <= nu <= n_a + n_b - 2 bounds and no change of axes changes.
//
// `point_sigma_mu` > 0 is how well a single point is known. Points on a plane or a line have a singular covariance, and
// a shift across it would be infinitely significant: no set is taken to be thinner in any direction than its points
// are known (eigenvalues of a covariance are raised to point_sigma_mu^2, and the answer says so). Sets that scatter
// more are not touched.
//
// Nothing for fewer than kFewestPoints points on a side, for values that are not finite, or for a covariance that stays
// singular because `point_sigma_mu` is 0.
std::optional<MeanTest> HotellingTest(const PointMoments& a, const PointMoments& b, double point_sigma_mu);

// The same test of a shift beyond a tolerance. The question is whether the means may lie within `min_shift_mu` of each
// other: T^2 is that of the least significant shift that remains when the difference is made up to min_shift_mu
// smaller, in whatever direction. Means that truly are not further apart are rejected with at most the probability that
// the p-value says. `min_shift_mu` 0 is HotellingTest.
std::optional<MeanTest> HotellingTestBeyond(const PointMoments& a, const PointMoments& b, double point_sigma_mu,
                                            double min_shift_mu);

// Whether `a` and `b` may be points of one thing: their means do not differ significantly (level `alpha`) by more than
// `min_shift_mu`. For two looks at one thing from different sides that is a share of its size: a quarter for looks
// 60 degrees apart, a half for opposite ones. Nothing when the points are too few to tell (see HotellingTest): the
// answer is then up to other evidence.
std::optional<bool> SamePlace(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b, double alpha,
                              double min_shift_mu, double point_sigma_mu);

}  // namespace romap::objects
