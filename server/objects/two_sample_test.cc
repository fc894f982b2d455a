#include "server/objects/two_sample_test.h"

#include <Eigen/Dense>
#include <cmath>
#include <numeric>
#include <unsupported/Eigen/SpecialFunctions>
#include <utility>

namespace romap::objects {
namespace {

constexpr int kDimensions = 3;

// Raises eigenvalues to `least`; whether any was lower.
bool RaiseEigenvalues(double least, Eigen::Matrix3d* covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(*covariance);
  if (solver.eigenvalues()[0] >= least) return false;
  *covariance =
      solver.eigenvectors() * solver.eigenvalues().cwiseMax(least).asDiagonal() * solver.eigenvectors().transpose();
  return true;
}

// The least (d - s)^T S^-1 (d - s) over all shifts s no longer than `tolerance`. With S = Q diag(l) Q^T and d in the
// axes Q, the best s is d_i / (1 + m l_i) for the multiplier m >= 0 that makes s just as long as the tolerance.
double LeastSquaredDistance(const Eigen::Vector3d& d, const Eigen::Matrix3d& S, double tolerance) {
  if (d.norm() <= tolerance) return 0;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(S);
  const Eigen::Vector3d along = solver.eigenvectors().transpose() * d;
  const Eigen::Array3d spread = solver.eigenvalues();
  if (!(tolerance > 0)) return (along.array().square() / spread).sum();
  const auto shift = [&](double m) -> Eigen::Vector3d { return along.array() / (1 + m * spread); };
  double low = 0, high = 1 / spread[0];
  while (shift(high).norm() > tolerance) high *= 2;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (shift(middle).norm() > tolerance ? low : high) = middle;
  }
  return ((along - shift(high)).array().square() / spread).sum();
}

// Mean, its variance, and the degrees of freedom of that.
struct ValueMoments {
  double mean = 0, mean_variance = 0, dof = 0;

  explicit ValueMoments(std::span<const double> values) : dof(static_cast<double>(values.size()) - 1) {
    const auto count = static_cast<double>(values.size());
    mean = std::accumulate(values.begin(), values.end(), 0.0) / count;
    for (const double value : values) mean_variance += (value - mean) * (value - mean) / (dof * count);
  }
};

}  // namespace

PointMoments PointMoments::Of(std::span<const Eigen::Vector3d> points) {
  PointMoments moments;
  moments.count = static_cast<int>(points.size());
  if (points.empty()) return moments;
  for (const Eigen::Vector3d& p : points) moments.mean += p;
  moments.mean /= moments.count;
  if (points.size() < 2) return moments;
  for (const Eigen::Vector3d& p : points) moments.covariance += (p - moments.mean) * (p - moments.mean).transpose();
  moments.covariance /= moments.count - 1;
  return moments;
}

double IncompleteBeta(double a, double b, double x) {
  if (x <= 0) return 0;
  if (x >= 1) return 1;
  return Eigen::numext::betainc(a, b, x);
}

double StudentTwoSidedP(double t, double dof) { return IncompleteBeta(0.5 * dof, 0.5, dof / (dof + t * t)); }

double FisherUpperP(double f, double d1, double d2) {
  return f <= 0 ? 1 : IncompleteBeta(0.5 * d2, 0.5 * d1, d2 / (d2 + d1 * f));
}

std::optional<MeanTest> WelchTest(std::span<const double> a, std::span<const double> b) {
  if (a.size() < 2 || b.size() < 2) return std::nullopt;
  const ValueMoments of_a(a), of_b(b);
  const double variance = of_a.mean_variance + of_b.mean_variance;
  if (!(variance > 0) || !std::isfinite(variance)) return std::nullopt;
  MeanTest test;
  test.statistic = (of_a.mean - of_b.mean) / std::sqrt(variance);
  test.dof = variance * variance /
             (of_a.mean_variance * of_a.mean_variance / of_a.dof + of_b.mean_variance * of_b.mean_variance / of_b.dof);
  test.p_value = StudentTwoSidedP(test.statistic, test.dof);
  return test;
}

std::optional<MeanTest> HotellingTest(const PointMoments& a, const PointMoments& b, double point_sigma_mu) {
  return HotellingTestBeyond(a, b, point_sigma_mu, 0);
}

std::optional<MeanTest> HotellingTestBeyond(const PointMoments& a, const PointMoments& b, double point_sigma_mu,
                                            double min_shift_mu) {
  if (a.count < kFewestPoints || b.count < kFewestPoints) return std::nullopt;
  if (!a.mean.allFinite() || !b.mean.allFinite() || !a.covariance.allFinite() || !b.covariance.allFinite()) {
    return std::nullopt;
  }
  MeanTest test;
  Eigen::Matrix3d of_mean_a = a.covariance, of_mean_b = b.covariance;
  for (Eigen::Matrix3d* covariance : {&of_mean_a, &of_mean_b}) {
    if (RaiseEigenvalues(point_sigma_mu * point_sigma_mu, covariance)) test.regularised = true;
  }
  of_mean_a /= a.count;
  of_mean_b /= b.count;
  const Eigen::Matrix3d S = of_mean_a + of_mean_b;
  constexpr double kSingular = 1e-14;  // smallest to largest eigenvalue
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(S, Eigen::EigenvaluesOnly);
  if (!(solver.eigenvalues()[0] > kSingular * solver.eigenvalues()[2])) return std::nullopt;

  const Eigen::Matrix3d inverse = S.inverse();
  const auto share = [&](const Eigen::Matrix3d& of_mean, int count) {
    const Eigen::Matrix3d M = of_mean * inverse;
    return ((M * M).trace() + M.trace() * M.trace()) / (count - 1);
  };
  test.statistic = LeastSquaredDistance(a.mean - b.mean, S, min_shift_mu);
  test.dof = kDimensions * (kDimensions + 1) / (share(of_mean_a, a.count) + share(of_mean_b, b.count));
  const double d2 = test.dof - kDimensions + 1;
  test.p_value = FisherUpperP(test.statistic * d2 / (test.dof * kDimensions), kDimensions, d2);
  return test;
}

std::optional<bool> SamePlace(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b, double alpha,
                              double min_shift_mu, double point_sigma_mu) {
  const auto test = HotellingTestBeyond(PointMoments::Of(a), PointMoments::Of(b), point_sigma_mu, min_shift_mu);
  if (!test) return std::nullopt;
  return test->p_value >= alpha;
}

}  // namespace romap::objects
