#include "server/slam/geometry/support_plane.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>
#include <vector>

#include "common/angles.h"
#include "common/statistics.h"
#include "server/slam/geometry/plane_fit.h"

namespace romap::slam {
namespace {

constexpr double kMaxTilt_rad = 75 * kRadPerDeg;
constexpr int kMinInliers = 12;
constexpr size_t kMinObjectPoints = 3;
constexpr int kTriples = 800;
constexpr double kPromisingShare = 0.7;  // of the best score so far
constexpr size_t kMaxCandidates = 30;
constexpr double kSame_rad = 0.5 * kRadPerDeg;
constexpr int kRefinements = 10;
// Lengths without a unit suffix are relative to the typical distance from a camera to the objects.
constexpr double kMinSigma = 0.002;  // minimum scatter of points on a real surface
constexpr double kMaxSigma = 0.03;   // less accurate points are ignored
constexpr double kInlierSigmas = 2.5;
// Weight of a point far from the objects' masks, relative to one near them.
constexpr double kFarWeight = 0.3;
constexpr double kReach = 0.25;  // distance around an object in which its support is searched
constexpr double kMinCamerasAbove = 0.9;
// Minimum standard deviation: the estimate covers only scatter, but maps are also bent and tables are not exactly flat.
constexpr double kSigmaFloor_rad = 0.3 * kRadPerDeg;
constexpr double kMinConfidence = 0.05;
constexpr size_t kMaxObjectPoints = 300;

double Ramp(double value, double zero_at, double one_at) {
  return std::clamp((value - zero_at) / (one_at - zero_at), 0.0, 1.0);
}

// The query without invalid values, with typical lengths and a weight for every point.
struct Scene {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> cameras;
  std::vector<Eigen::Vector3d> object_points;
  double distance_mu = 0;       // from the cameras to the objects
  double object_spread_mu = 0;  // of the object points around their median

  std::vector<Eigen::Vector3d> points;
  std::vector<double> sigmas_mu;
  std::vector<double> closeness;  // to the objects, 0..1
  std::vector<double> weights;    // by closeness and precision
};

// Computes median and typical lengths. False: invalid cameras or objects.
bool MeasureScene(const SupportPlaneQuery& query, Scene& scene) {
  for (const auto& up : query.camera_ups_world) {
    if (up.allFinite()) scene.up += up.stableNormalized();
  }
  for (const auto& center : query.camera_centers_world) {
    if (center.allFinite()) scene.cameras.push_back(center);
  }
  const size_t stride = query.object_points_world.size() / kMaxObjectPoints + 1;
  for (size_t i = 0; i < query.object_points_world.size(); i += stride) {
    if (query.object_points_world[i].allFinite()) scene.object_points.push_back(query.object_points_world[i]);
  }
  if (!(scene.up.norm() > 1e-3) || scene.cameras.empty() || scene.object_points.size() < kMinObjectPoints) return false;
  scene.up.normalize();

  Eigen::Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const auto& p : scene.object_points) values.push_back(p[axis]);
    middle[axis] = LowerQuantile(std::move(values), 0.5);
  }
  const auto distance = [&](const std::vector<Eigen::Vector3d>& points, double share) {
    std::vector<double> distances;
    for (const auto& p : points) distances.push_back((p - middle).norm());
    return LowerQuantile(std::move(distances), share);
  };
  scene.distance_mu = distance(scene.cameras, 0.5);
  scene.object_spread_mu = distance(scene.object_points, 0.8);  // masks include some background
  return scene.distance_mu > 0;
}

double DistanceToObjects(const Scene& scene, const Eigen::Vector3d& p) {
  double nearest_squared = (p - scene.object_points[0]).squaredNorm();
  for (const auto& object_point : scene.object_points) {
    nearest_squared = std::min(nearest_squared, (p - object_point).squaredNorm());
  }
  return std::sqrt(nearest_squared);
}

void WeightPoints(const SupportPlaneQuery& query, Scene& scene) {
  const double min_sigma_mu = kMinSigma * scene.distance_mu;
  // Points near a mask in the image may be far away in space, such as the floor behind the table.
  const double reach_mu = std::max(2 * scene.object_spread_mu, kReach * scene.distance_mu);
  for (const SupportPoint& point : query.points) {
    if (!point.position_world.allFinite() || !(point.sigma_mu <= kMaxSigma * scene.distance_mu)) continue;
    const double sigma_mu = std::hypot(point.sigma_mu, min_sigma_mu);
    const double distance = DistanceToObjects(scene, point.position_world) / reach_mu;
    const double closeness = (point.near_object ? 1 : kFarWeight) / std::pow(1 + distance * distance, 2);
    scene.points.push_back(point.position_world);
    scene.sigmas_mu.push_back(sigma_mu);
    scene.closeness.push_back(closeness);
    scene.weights.push_back(closeness * std::pow(min_sigma_mu / sigma_mu, 2));
  }
}

// Plausibility, 0..1, that this plane supports the objects, regardless of the points on it.
double SupportPlausibility(const Scene& scene, const Plane& plane) {
  const auto above = [&](const Eigen::Vector3d& p) { return plane.Height(p) > 0; };
  const auto cameras_above = static_cast<double>(std::ranges::count_if(scene.cameras, above));
  if (cameras_above < kMinCamerasAbove * static_cast<double>(scene.cameras.size())) return 0;

  std::vector<double> heights;
  for (const auto& p : scene.object_points) heights.push_back(plane.Height(p));
  const double low = LowerQuantile(heights, 0.1);
  const double extent = LowerQuantile(heights, 0.9) - low;
  // Masks are inexact and include some points behind and below the object.
  const double tolerance = 0.1 * extent + 3 * kMinSigma * scene.distance_mu;
  const auto below = static_cast<double>(std::ranges::count_if(heights, [&](double h) { return h < -tolerance; }));
  const double share_score = 1 - Ramp(below / static_cast<double>(heights.size()), 0.1, 0.3);
  // The lowest observed points of an object may be above its bottom, but not by several object heights.
  const double gap = std::max(0.0, low) / (extent + 0.02 * scene.distance_mu);
  return share_score / (1 + std::pow(gap, 4));
}

// Score of one point for the plane: its weight when on the plane, 0 when off it.
double SupportOf(const Scene& scene, const Plane& plane, size_t point) {
  const double residual = plane.Height(scene.points[point]) / (kInlierSigmas * scene.sigmas_mu[point]);
  return scene.weights[point] * std::max(0.0, 1 - residual * residual);
}

double Support(const Scene& scene, const Plane& plane) {
  double support = 0;
  for (size_t i = 0; i < scene.points.size(); ++i) support += SupportOf(scene, plane, i);
  return support;
}

// Alternates between reweighting the points and refitting the plane. The weights are Tukey's biweight, with a scale
// estimated from the residuals because the given uncertainties are often wrong by a factor. nullopt: no plane fits.
std::optional<PlaneFit> Refine(const Scene& scene, const Plane& start) {
  PlaneFit fit{.plane = start, .sigma_rad = 0};
  double scale = 1;  // of the residuals, in units of the points' sigmas
  for (int round = 0; round < kRefinements; ++round) {
    std::vector<double> near;
    std::vector<double> weights(scene.points.size(), 0.0);
    for (size_t i = 0; i < scene.points.size(); ++i) {
      const double residual = std::abs(fit.plane.Height(scene.points[i])) / scene.sigmas_mu[i];
      if (residual <= kInlierSigmas) near.push_back(residual);
      const double relative = residual / (4.685 * scale);
      if (relative < 1) weights[i] = scene.weights[i] * std::pow(1 - relative * relative, 2);
    }
    if (std::ssize(near) < kMinInliers) return std::nullopt;
    scale = std::clamp(1.4826 * LowerQuantile(near, 0.5), 0.2, 1.0);
    const auto refit = FitPlane(scene.points, weights, scene.up);
    if (!refit) return std::nullopt;
    fit = *refit;
  }
  return fit;
}

bool IsLevel(const Scene& scene, const Plane& plane) { return plane.normal.dot(scene.up) > std::cos(kMaxTilt_rad); }

bool IsInlier(const Scene& scene, const Plane& plane, size_t point) {
  return std::abs(plane.Height(scene.points[point])) <= kInlierSigmas * scene.sigmas_mu[point];
}

struct Candidate {
  Plane plane;
  double score = 0;
};

double Score(const Scene& scene, const Plane& plane) {
  return IsLevel(scene, plane) ? Support(scene, plane) * SupportPlausibility(scene, plane) : 0;
}

// Promising planes through three points drawn in proportion to their weights, best first (RANSAC with the score of
// MSAC: Torr and Zisserman, 2000).
std::vector<Candidate> SearchPlanes(const Scene& scene, uint64_t seed) {
  std::mt19937_64 random(seed);
  std::discrete_distribution<size_t> draw(scene.weights.begin(), scene.weights.end());
  std::vector<Candidate> candidates;
  double best_score = 0;
  for (int i = 0; i < kTriples; ++i) {
    auto plane = PlaneThrough(scene.points[draw(random)], scene.points[draw(random)], scene.points[draw(random)]);
    if (!plane) continue;
    if (plane->normal.dot(scene.up) < 0) *plane = {-plane->normal, -plane->offset_mu};
    const double score = Score(scene, *plane);
    best_score = std::max(best_score, score);
    if (score > kPromisingShare * best_score) candidates.push_back({*plane, score});
  }
  std::ranges::stable_sort(candidates, std::ranges::greater(), &Candidate::score);
  candidates.resize(std::min(candidates.size(), kMaxCandidates));
  return candidates;
}

struct FoundPlane {
  PlaneFit fit;
  double score = 0;
};

// Likelihood that `other` would score as high as `best` with another sample of points from the same surfaces: 1 if the
// scores are equal; decreases with the number of points that contradict `other`. Points that agree with both planes do
// not count.
double RelativeLikelihood(const Scene& scene, const FoundPlane& best, const FoundPlane& other) {
  const double best_plausibility = SupportPlausibility(scene, best.fit.plane);
  const double other_plausibility = SupportPlausibility(scene, other.fit.plane);
  double variance = 0;
  for (size_t i = 0; i < scene.points.size(); ++i) {
    variance += std::pow(best_plausibility * SupportOf(scene, best.fit.plane, i) -
                             other_plausibility * SupportOf(scene, other.fit.plane, i),
                         2);
  }
  const double deficit = best.score - other.score;
  return deficit > 0 ? std::exp(-deficit * deficit / (2 * variance)) : 1;
}

// The best of the candidates after refinement. With few points or clutter next to the support, other planes may explain
// the points about as well; the standard deviation accounts for them. nullopt: no candidate is plausible.
std::optional<PlaneFit> ChoosePlane(const Scene& scene, std::span<const Candidate> candidates) {
  std::vector<FoundPlane> refined;
  for (const Candidate& candidate : candidates) {
    const auto fit = Refine(scene, candidate.plane);
    const double score = fit ? Score(scene, fit->plane) : 0;
    if (score > 0) refined.push_back({*fit, score});
  }
  if (refined.empty()) return std::nullopt;
  std::ranges::stable_sort(refined, std::ranges::greater(), &FoundPlane::score);
  const FoundPlane& best = refined[0];

  double likelihoods = 0;
  double variance = 0;
  std::vector<Eigen::Vector3d> normals;
  for (const FoundPlane& other : refined) {
    const auto is_same = [&](const Eigen::Vector3d& normal) {
      return AngleBetween(normal, other.fit.plane.normal) < kSame_rad;
    };
    if (std::ranges::any_of(normals, is_same)) continue;
    normals.push_back(other.fit.plane.normal);
    const double likelihood = RelativeLikelihood(scene, best, other);
    likelihoods += likelihood;
    variance += likelihood * std::pow(AngleBetween(best.fit.plane.normal, other.fit.plane.normal), 2);
  }
  PlaneFit chosen = best.fit;
  chosen.sigma_rad = std::hypot(chosen.sigma_rad, std::sqrt(variance / likelihoods), kSigmaFloor_rad);
  return chosen;
}

// Share of the object points that have inliers around their projection onto the plane.
double SupportedShare(const Scene& scene, const Plane& plane, std::span<const size_t> inliers) {
  const double reach_mu = kReach * scene.distance_mu;
  const auto is_supported = [&](const Eigen::Vector3d& p) {
    const Eigen::Vector3d projection = p - plane.Height(p) * plane.normal;
    return std::ranges::any_of(inliers, [&](size_t i) { return (scene.points[i] - projection).norm() < reach_mu; });
  };
  return static_cast<double>(std::ranges::count_if(scene.object_points, is_supported)) /
         static_cast<double>(scene.object_points.size());
}

double Confidence(const Scene& scene, const PlaneFit& fit, std::span<const size_t> inliers) {
  double inlier_weight = 0;
  double close_inliers = 0;
  for (const size_t i : inliers) {
    inlier_weight += scene.weights[i];
    close_inliers += scene.closeness[i];
  }
  const double all_weight = std::accumulate(scene.weights.begin(), scene.weights.end(), 0.0);
  const double sharpness = 1 / (1 + std::pow(fit.sigma_rad / (2 * kRadPerDeg), 2));
  // Few inliers near the objects and many far away indicate another surface.
  return Ramp(inlier_weight / all_weight, 0.1, 0.4) * Ramp(close_inliers, 3, 15) * sharpness *
         SupportedShare(scene, fit.plane, inliers) * SupportPlausibility(scene, fit.plane);
}

}  // namespace

std::optional<SupportPlane> FindSupportPlane(const SupportPlaneQuery& query) {
  Scene scene;
  if (!MeasureScene(query, scene)) return std::nullopt;
  WeightPoints(query, scene);
  if (std::ssize(scene.points) < kMinInliers) return std::nullopt;
  const auto fit = ChoosePlane(scene, SearchPlanes(scene, query.seed));
  if (!fit) return std::nullopt;

  std::vector<size_t> inliers;
  for (size_t i = 0; i < scene.points.size(); ++i) {
    if (IsInlier(scene, fit->plane, i)) inliers.push_back(i);
  }
  const double confidence = Confidence(scene, *fit, inliers);
  if (std::ssize(inliers) < kMinInliers || confidence < kMinConfidence) return std::nullopt;
  return SupportPlane{.normal_world = fit->plane.normal,
                      .offset_mu = fit->plane.offset_mu,
                      .sigma_rad = fit->sigma_rad,
                      .confidence = confidence,
                      .inliers = static_cast<int>(inliers.size())};
}

}  // namespace romap::slam
