#include "server/objects/pca_yaw.h"

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

namespace romap::objects {

std::optional<double> PcaYaw(std::span<const Eigen::Vector3d> points) {
  constexpr size_t kMinPoints = 8;
  constexpr int kIterations = 10;
  constexpr double kMinElongation = 1.1;  // ratio of the standard deviations along and across
  if (points.size() < kMinPoints) return std::nullopt;
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Identity();
  for (int iteration = 0; iteration <= kIterations; ++iteration) {
    const Eigen::Matrix2d information = scatter.inverse();
    double total = 0;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    Eigen::Matrix2d products = Eigen::Matrix2d::Zero();
    for (const Eigen::Vector3d& p : points) {
      const Eigen::Vector2d offset = p.head<2>() - center;
      // The first iteration has no scale for the weights.
      const double weight = iteration == 0 ? 1 : 3 / (1 + offset.dot(information * offset));
      total += weight;
      sum += weight * p.head<2>();
      products += weight * offset * offset.transpose();
    }
    const Eigen::Vector2d next_center = sum / total;
    const Eigen::Vector2d shift = next_center - center;
    scatter = products / static_cast<double>(points.size());
    // The products of the first iteration are about the origin and not about the mean.
    if (iteration == 0) scatter -= shift * shift.transpose();
    center = next_center;
    if (!(scatter.determinant() > 0)) break;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(scatter);
  const Eigen::Vector2d variances = axes.eigenvalues();  // ascending
  if (!(variances[1] > kMinElongation * kMinElongation * std::max(0.0, variances[0]))) return std::nullopt;
  const Eigen::Vector2d main = axes.eigenvectors().col(1);
  return std::atan2(main.x() < 0 ? -main.y() : main.y(), std::abs(main.x()));
}

}  // namespace romap::objects
