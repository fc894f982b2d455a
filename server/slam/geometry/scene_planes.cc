#include "server/slam/geometry/scene_planes.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>

#include "common/angles.h"
#include "common/statistics.h"

namespace romap::slam {
namespace {

constexpr int kPlaneTriples = 300;
constexpr size_t kMaxPlanes = 3;
constexpr int kMinPlaneInliers = 30;
constexpr double kPlaneInlierSigmas = 2.5;
constexpr double kMinPlaneSigma = 0.002;  // scatter of points on a real surface, in terms of the size of the scene
constexpr double kMaxPlaneSigma = 0.03;   // less accurate points are ignored, in the same terms
constexpr int kPlaneRefinements = 6;
// A plane through a cloud of points has as many points beside it as on it.
constexpr double kBesideWidths = 3;  // of the slab that is compared with the inliers, in terms of their slab
constexpr double kMinContrast = 2;   // ratio of the densities
constexpr double kMaxDirectionSigma_rad = 3 * kRadPerDeg;
// Maps from images are bent, most of all far from the cameras.
constexpr double kPlaneSigmaFloor_rad = 2 * kRadPerDeg;
// Nearly parallel planes are one surface or opposite walls: the second one adds nothing about the direction of up.
constexpr double kParallel_rad = 20 * kRadPerDeg;

struct Cloud {
  std::vector<Eigen::Vector3d> points;
  std::vector<double> sigmas_mu;

  double Residual(const Plane& plane, size_t i) const { return std::abs(plane.Height(points[i])) / sigmas_mu[i]; }
  int CountWithin(const Plane& plane, double sigmas) const {
    int count = 0;
    for (size_t i = 0; i < points.size(); ++i) count += Residual(plane, i) < sigmas ? 1 : 0;
    return count;
  }
};

Cloud AccuratePoints(std::span<const SupportPoint> points) {
  Cloud cloud;
  std::vector<double> distances;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const SupportPoint& point : points) {
    if (point.position_world.allFinite() && std::isfinite(point.sigma_mu)) cloud.points.push_back(point.position_world);
  }
  if (cloud.points.empty()) return cloud;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Eigen::Vector3d& p : cloud.points) values.push_back(p[axis]);
    mean[axis] = LowerQuantile(std::move(values), 0.5);
  }
  for (const Eigen::Vector3d& p : cloud.points) distances.push_back((p - mean).norm());
  const double size_mu = LowerQuantile(std::move(distances), 0.5);
  cloud.points.clear();
  for (const SupportPoint& point : points) {
    if (!point.position_world.allFinite() || !(point.sigma_mu < kMaxPlaneSigma * size_mu)) continue;
    cloud.points.push_back(point.position_world);
    cloud.sigmas_mu.push_back(std::hypot(point.sigma_mu, kMinPlaneSigma * size_mu));
  }
  return cloud;
}

std::optional<Plane> MostPopularPlane(const Cloud& cloud, std::mt19937_64& random) {
  std::uniform_int_distribution<size_t> draw(0, cloud.points.size() - 1);
  std::optional<Plane> best;
  int best_count = 0;
  for (int i = 0; i < kPlaneTriples; ++i) {
    const auto plane = PlaneThrough(cloud.points[draw(random)], cloud.points[draw(random)], cloud.points[draw(random)]);
    if (!plane) continue;
    const int count = cloud.CountWithin(*plane, kPlaneInlierSigmas);
    if (count <= best_count) continue;
    best_count = count;
    best = plane;
  }
  return best;
}

std::optional<PlaneFit> Refit(const Cloud& cloud, const Plane& start) {
  PlaneFit fit{.plane = start};
  for (int round = 0; round < kPlaneRefinements; ++round) {
    std::vector<double> weights(cloud.points.size(), 0.0);
    for (size_t i = 0; i < weights.size(); ++i) {
      const double relative = cloud.Residual(fit.plane, i) / kPlaneInlierSigmas;
      if (relative < 1) weights[i] = std::pow((1 - relative * relative) / cloud.sigmas_mu[i], 2);
    }
    const auto refit = FitPlane(cloud.points, weights, fit.plane.normal);
    if (!refit) return std::nullopt;
    fit = *refit;
  }
  fit.sigma_rad = std::hypot(fit.sigma_rad, kPlaneSigmaFloor_rad);
  return fit;
}

bool StandsOut(const Cloud& cloud, const PlaneFit& fit) {
  const int inliers = cloud.CountWithin(fit.plane, kPlaneInlierSigmas);
  const int beside = cloud.CountWithin(fit.plane, kBesideWidths * kPlaneInlierSigmas) - inliers;
  return inliers >= kMinPlaneInliers && inliers * (kBesideWidths - 1) >= kMinContrast * beside &&
         fit.sigma_rad < kMaxDirectionSigma_rad;
}

void RemoveInliers(const Plane& plane, Cloud& cloud) {
  Cloud rest;
  for (size_t i = 0; i < cloud.points.size(); ++i) {
    if (cloud.Residual(plane, i) < kPlaneInlierSigmas) continue;
    rest.points.push_back(cloud.points[i]);
    rest.sigmas_mu.push_back(cloud.sigmas_mu[i]);
  }
  cloud = std::move(rest);
}

}  // namespace

std::vector<PlaneFit> FindScenePlanes(std::span<const SupportPoint> points, uint64_t seed) {
  std::mt19937_64 random(seed);
  Cloud cloud = AccuratePoints(points);
  std::vector<PlaneFit> planes;
  // The most popular plane may lie across the scene; others are searched after it.
  for (size_t i = 0; i < 2 * kMaxPlanes && planes.size() < kMaxPlanes; ++i) {
    if (cloud.points.size() < static_cast<size_t>(kMinPlaneInliers)) break;
    const auto plane = MostPopularPlane(cloud, random);
    const auto fit = plane ? Refit(cloud, *plane) : std::nullopt;
    if (!fit) break;
    const bool is_parallel = std::ranges::any_of(planes, [&](const PlaneFit& plane_before) {
      return std::abs(plane_before.plane.normal.dot(fit->plane.normal)) > std::cos(kParallel_rad);
    });
    if (!is_parallel && StandsOut(cloud, *fit)) planes.push_back(*fit);
    RemoveInliers(fit->plane, cloud);
  }
  return planes;
}

}  // namespace romap::slam
