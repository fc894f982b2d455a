#include "server/slam/geometry/world_alignment.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "common/statistics.h"
#include "server/slam/geometry/rotation.h"

namespace romap::slam {
namespace {

constexpr double kSigmasToAgree = 3;
// Of the length of a vector with three independent normal components: standard deviation of one over the median length.
constexpr double kSigmaPerMedianLength = 1 / 1.538;

Eigen::Quaterniond RotationOf(const TwoWorldPose& pair) {
  return pair.T_given_camera.rotation() * pair.T_map_camera.rotation().conjugate();
}

// The rotation of the pair that differs least from all others, by the median of the angles.
Eigen::Quaterniond MedianRotation(std::span<const TwoWorldPose> pairs) {
  Eigen::Quaterniond best = Eigen::Quaterniond::Identity();
  double least_rad = 1e9;
  for (const TwoWorldPose& candidate : pairs) {
    std::vector<double> angles_rad;
    for (const TwoWorldPose& pair : pairs)
      angles_rad.push_back(RotationOf(candidate).angularDistance(RotationOf(pair)));
    const double median_rad = Median(std::move(angles_rad));
    if (median_rad >= least_rad) continue;
    least_rad = median_rad;
    best = RotationOf(candidate);
  }
  return best;
}

// Mean of the rotations within `bound_rad` of `start`, by their differences from it.
Eigen::Quaterniond MeanRotation(std::span<const TwoWorldPose> pairs, const Eigen::Quaterniond& start,
                                double bound_rad) {
  Eigen::Vector3d sum_rad = Eigen::Vector3d::Zero();
  int count = 0;
  for (const TwoWorldPose& pair : pairs) {
    const Eigen::AngleAxisd difference(start.conjugate() * RotationOf(pair));
    if (difference.angle() > bound_rad) continue;
    sum_rad += difference.angle() * difference.axis();
    ++count;
  }
  return start * Eigen::Quaterniond(ExpRotationMatrix(sum_rad / std::max(1, count)));
}

Eigen::Vector3d MedianVector(const std::vector<Eigen::Vector3d>& vectors) {
  Eigen::Vector3d median;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Eigen::Vector3d& v : vectors) values.push_back(v(axis));
    median(axis) = Median(std::move(values));
  }
  return median;
}

// Median of the ratios of distances between two cameras, along the direction between them, of all pairs of cameras that
// are at least as far apart as half of them. nullopt: they do not move.
std::optional<double> MedianScale(std::span<const TwoWorldPose> pairs, const Eigen::Quaterniond& R_given_map) {
  struct Ratio {
    double distance_mu;
    double scale;
  };
  std::vector<Ratio> ratios;
  std::vector<double> distances_mu;
  for (size_t i = 0; i < pairs.size(); ++i) {
    for (size_t j = i + 1; j < pairs.size(); ++j) {
      const Eigen::Vector3d in_map = pairs[j].T_map_camera.translation() - pairs[i].T_map_camera.translation();
      const Eigen::Vector3d given = pairs[j].T_given_camera.translation() - pairs[i].T_given_camera.translation();
      const double distance_mu = in_map.norm();
      if (!(distance_mu > 0)) continue;
      ratios.push_back({distance_mu, (R_given_map * in_map).dot(given) / (distance_mu * distance_mu)});
      distances_mu.push_back(distance_mu);
    }
  }
  if (ratios.empty()) return std::nullopt;
  const double typical_mu = Median(std::move(distances_mu));
  std::vector<double> scales;
  for (const Ratio& ratio : ratios) {
    if (ratio.distance_mu >= typical_mu) scales.push_back(ratio.scale);
  }
  return Median(std::move(scales));
}

}  // namespace

std::optional<WorldAlignment> AlignWorlds(std::span<const TwoWorldPose> pairs, bool fix_scale) {
  if (pairs.size() < kMinTwoWorldPoses) return std::nullopt;
  const Eigen::Quaterniond start = MedianRotation(pairs);
  std::vector<double> angles_rad;
  for (const TwoWorldPose& pair : pairs) angles_rad.push_back(start.angularDistance(RotationOf(pair)));
  const double bound_rad = kSigmasToAgree * std::sqrt(3.0) * kSigmaPerMedianLength * Median(angles_rad) + 1e-9;
  const Eigen::Quaterniond R_given_map = MeanRotation(pairs, start, bound_rad);

  const std::optional<double> scale = fix_scale ? 1.0 : MedianScale(pairs, R_given_map);
  if (!scale || !(*scale > 0)) return std::nullopt;
  std::vector<Eigen::Vector3d> offsets, given_centers;
  for (const TwoWorldPose& pair : pairs) {
    given_centers.push_back(pair.T_given_camera.translation());
    offsets.push_back(given_centers.back() - *scale * (R_given_map * pair.T_map_camera.translation()));
  }
  WorldAlignment alignment{.S_given_map = {*scale, R_given_map, MedianVector(offsets)}};

  std::vector<double> residuals_mu, residuals_rad;
  for (const TwoWorldPose& pair : pairs) {
    const SE3<World, Camera> expected = alignment.S_given_map.Moved(pair.T_map_camera);
    residuals_mu.push_back((expected.translation() - pair.T_given_camera.translation()).norm());
    residuals_rad.push_back(expected.rotation().angularDistance(pair.T_given_camera.rotation()));
  }
  alignment.position_sigma_mu = kSigmaPerMedianLength * Median(residuals_mu);
  alignment.rotation_sigma_rad = kSigmaPerMedianLength * Median(residuals_rad);
  alignment.max_position_mu = *std::max_element(residuals_mu.begin(), residuals_mu.end());
  alignment.max_rotation_rad = *std::max_element(residuals_rad.begin(), residuals_rad.end());
  const double max_mu = kSigmasToAgree * std::sqrt(3.0) * alignment.position_sigma_mu + 1e-9;
  const double max_rad = kSigmasToAgree * std::sqrt(3.0) * alignment.rotation_sigma_rad + 1e-9;
  size_t agreeing = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < pairs.size(); ++i) {
    agreeing += residuals_mu[i] <= max_mu && residuals_rad[i] <= max_rad ? 1 : 0;
    sum += given_centers[i];
  }
  const auto count = static_cast<double>(pairs.size());
  double squares_mu2 = 0;
  for (const Eigen::Vector3d& center : given_centers) squares_mu2 += (center - sum / count).squaredNorm();
  alignment.agreeing_share = static_cast<double>(agreeing) / count;
  alignment.extent_mu = std::sqrt(squares_mu2 / count);
  const double pairs_root = std::sqrt(static_cast<double>(std::max<size_t>(1, agreeing)));
  alignment.alignment_sigma_rad = alignment.rotation_sigma_rad / pairs_root;
  if (!fix_scale) {
    if (!(alignment.extent_mu > 0)) return std::nullopt;
    alignment.scale_sigma_ratio = alignment.position_sigma_mu / (alignment.extent_mu * pairs_root);
  }
  return alignment;
}

}  // namespace romap::slam
