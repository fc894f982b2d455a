#include "server/slam/triangulation.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "server/slam/geometry/levenberg_marquardt.h"

namespace romap::slam {
namespace {

constexpr int kMaxIterations = 5;
constexpr double kConverged = 1e-5;        // step over distance
constexpr double kRangeChi2Bound = 3.841;  // 95 %, one degree of freedom

struct Normals {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double cost = 0;
};

// With offset d = p - c and bearing b, the error across the ray is e = (I - b b^T) d / (b^T d), in radians for small
// angles; its derivative is taken at constant distance b^T d.
void Accumulate(const ObservedRay& ray, const Eigen::Vector3d& p_world, Normals& normals) {
  const Eigen::Vector3d offset = p_world - ray.center_world;
  const double along = ray.bearing_world.dot(offset);
  if (along <= 0) {
    normals.cost = std::numeric_limits<double>::infinity();
    return;
  }
  const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray.bearing_world * ray.bearing_world.transpose();
  const double scale = 1 / (along * ray.bearing_sigma_rad);
  const double chi2 = BearingChi2(ray, p_world);
  const double weight = HuberWeight(chi2, kBearingChi2Bound) * scale * scale;
  normals.hessian += weight * across;
  normals.gradient += weight * across * offset;
  normals.cost += HuberCost(chi2, kBearingChi2Bound);

  if (ray.range_mu <= 0) return;
  const double error = (along - ray.range_mu) / ray.range_sigma_mu;
  const double range_weight = HuberWeight(error * error, kRangeChi2Bound) / (ray.range_sigma_mu * ray.range_sigma_mu);
  normals.hessian += range_weight * ray.bearing_world * ray.bearing_world.transpose();
  normals.gradient += range_weight * (along - ray.range_mu) * ray.bearing_world;
  normals.cost += HuberCost(error * error, kRangeChi2Bound);
}

Normals AccumulateAll(const std::vector<ObservedRay>& rays, const Eigen::Vector3d& p_world) {
  Normals normals;
  for (const ObservedRay& ray : rays) Accumulate(ray, p_world, normals);
  return normals;
}

}  // namespace

double BearingChi2(const ObservedRay& ray, const Eigen::Vector3d& p_world) {
  const Eigen::Vector3d offset = p_world - ray.center_world;
  const double along = ray.bearing_world.dot(offset);
  if (along <= 0) return std::numeric_limits<double>::infinity();
  const double error_rad = (offset - along * ray.bearing_world).norm() / along;
  return error_rad * error_rad / (ray.bearing_sigma_rad * ray.bearing_sigma_rad);
}

bool Agrees(const ObservedRay& ray, const Eigen::Vector3d& p_world) {
  if (BearingChi2(ray, p_world) > kBearingChi2Bound) return false;
  const double range_mu = (p_world - ray.center_world).norm();
  return ray.range_mu <= 0 || std::abs(range_mu - ray.range_mu) <= 3 * ray.range_sigma_mu;
}

double Parallax_rad(const ObservedRay& a, const ObservedRay& b, const Eigen::Vector3d& p_world) {
  const Eigen::Vector3d ray_a = p_world - a.center_world;
  const Eigen::Vector3d ray_b = p_world - b.center_world;
  return std::atan2(ray_a.cross(ray_b).norm(), ray_a.dot(ray_b));
}

std::optional<Eigen::Vector3d> IntersectRays(const ObservedRay& a, const ObservedRay& b) {
  const Eigen::Vector3d baseline = b.center_world - a.center_world;
  const double cosine = a.bearing_world.dot(b.bearing_world);
  const double determinant = 1 - cosine * cosine;
  if (determinant < 1e-9) return std::nullopt;
  const double along_a = (a.bearing_world.dot(baseline) - cosine * b.bearing_world.dot(baseline)) / determinant;
  const double along_b = (cosine * a.bearing_world.dot(baseline) - b.bearing_world.dot(baseline)) / determinant;
  if (along_a <= 0 || along_b <= 0) return std::nullopt;
  return 0.5 * (a.center_world + along_a * a.bearing_world + b.center_world + along_b * b.bearing_world);
}

Eigen::Vector3d RefinePoint(const std::vector<ObservedRay>& rays, const Eigen::Vector3d& p_world) {
  Eigen::Vector3d best = p_world;
  Normals normals = AccumulateAll(rays, best);
  for (int iteration = 0; iteration < kMaxIterations && std::isfinite(normals.cost); ++iteration) {
    const Eigen::Vector3d step = -normals.hessian.ldlt().solve(normals.gradient);
    if (!step.allFinite()) break;
    const Eigen::Vector3d candidate = best + step;
    const Normals after = AccumulateAll(rays, candidate);
    if (!(after.cost < normals.cost)) break;
    const double distance = (candidate - rays.front().center_world).norm();
    best = candidate;
    normals = after;
    if (step.norm() < kConverged * distance) break;
  }
  return best;
}

}  // namespace romap::slam
