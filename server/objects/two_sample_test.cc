#include "server/objects/two_sample_test.h"

#include <Eigen/Dense>
#include <cmath>
#include <unsupported/Eigen/SpecialFunctions>
#include <utility>

namespace romap::objects {
namespace {

constexpr int kDimensions = 3;

// Raises eigenvalues to `min_value`; returns whether any was lower.
bool RaiseEigenvalues(double min_value, Eigen::Matrix3d* covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(*covariance);
  if (solver.eigenvalues()[0] >= min_value) return false;
  *covariance =
      solver.eigenvectors() * solver.eigenvalues().cwiseMax(min_value).asDiagonal() * solver.eigenvectors().transpose();
  return true;
}

// The minimum of (d - s)^T S^-1 (d - s) over all shifts s of at most length `tolerance`. With S = Q diag(l) Q^T and d
// in the axes Q, the minimizer is s_i = d_i / (1 + m l_i) for the multiplier m >= 0 at which |s| equals the tolerance.
double MinSquaredDistance(const Eigen::Vector3d& d, const Eigen::Matrix3d& S, double tolerance) {
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

double FisherUpperP(double f, double d1, double d2) {
  return f <= 0 ? 1 : IncompleteBeta(0.5 * d2, 0.5 * d1, d2 / (d2 + d1 * f));
}

std::optional<MeanTest> HotellingTest(const PointMoments& a, const PointMoments& b, double point_sigma_mu,
                                      double min_shift_mu) {
  if (a.count < kMinTestPoints || b.count < kMinTestPoints) return std::nullopt;
  if (!a.mean.allFinite() || !b.mean.allFinite() || !a.covariance.allFinite() || !b.covariance.allFinite()) {
    return std::nullopt;
  }
  MeanTest test;
  Eigen::Matrix3d of_mean_a = a.covariance, of_mean_b = b.covariance;
  for (Eigen::Matrix3d* covariance : {&of_mean_a, &of_mean_b}) {
    if (RaiseEigenvalues(point_sigma_mu * point_sigma_mu, covariance)) test.regularized = true;
  }
  of_mean_a /= a.count;
  of_mean_b /= b.count;
  const Eigen::Matrix3d S = of_mean_a + of_mean_b;
  constexpr double kSingular = 1e-14;  // ratio of the smallest to the largest eigenvalue
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(S, Eigen::EigenvaluesOnly);
  if (!(solver.eigenvalues()[0] > kSingular * solver.eigenvalues()[2])) return std::nullopt;

  const Eigen::Matrix3d inverse = S.inverse();
  const auto share = [&](const Eigen::Matrix3d& of_mean, int count) {
    const Eigen::Matrix3d M = of_mean * inverse;
    return ((M * M).trace() + M.trace() * M.trace()) / (count - 1);
  };
  test.statistic = MinSquaredDistance(a.mean - b.mean, S, min_shift_mu);
  test.dof = kDimensions * (kDimensions + 1) / (share(of_mean_a, a.count) + share(of_mean_b, b.count));
  const double d2 = test.dof - kDimensions + 1;
  test.p_value = FisherUpperP(test.statistic * d2 / (test.dof * kDimensions), kDimensions, d2);
  return test;
}

std::optional<bool> MeansAgree(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b, double alpha,
                               double min_shift_mu, double point_sigma_mu) {
  const auto test = HotellingTest(PointMoments::Of(a), PointMoments::Of(b), point_sigma_mu, min_shift_mu);
  if (!test) return std::nullopt;
  return test->p_value >= alpha;
}

}  // namespace romap::objects
