#include "client/eval/alignment.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <cmath>
#include <limits>

#include "client/files/associate.h"

namespace romap::eval {
namespace {

constexpr double kMinScale = 1e-9;  // division by a smaller scale would amplify rounding errors

using PointMatrix = Eigen::Map<const Eigen::Matrix<double, 3, Eigen::Dynamic>>;

PointMatrix AsMatrix(const Points& points) {
  static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double), "points must be contiguous");
  return {points.front().data(), 3, static_cast<Eigen::Index>(points.size())};
}

std::vector<int64_t> TimestampsOf(std::span<const files::StampedPose> poses) {
  std::vector<int64_t> timestamps_ns;
  timestamps_ns.reserve(poses.size());
  for (const files::StampedPose& pose : poses) timestamps_ns.push_back(pose.timestamp_ns);
  return timestamps_ns;
}

}  // namespace

std::string ToString(Alignment alignment) {
  switch (alignment) {
    case Alignment::kNone:
      return "none";
    case Alignment::kSe3:
      return "se3";
    case Alignment::kSim3:
      return "sim3";
  }
  return "unknown";
}

Points Transform(const Sim3<World, World>& similarity, const Points& points) {
  Points transformed;
  transformed.reserve(points.size());
  for (const Eigen::Vector3d& point : points) transformed.push_back(similarity * point);
  return transformed;
}

std::optional<Sim3<World, World>> FitSimilarity(const Points& x, const Points& y, bool with_scale) {
  if (x.empty()) return std::nullopt;
  const PointMatrix from = AsMatrix(x);
  const Eigen::Vector3d mean = from.rowwise().mean();
  if ((from.colwise() - mean).squaredNorm() / static_cast<double>(x.size()) < 1e-18) return std::nullopt;
  const Eigen::Matrix4d matrix = Eigen::umeyama(from, AsMatrix(y), with_scale);
  const double scale = with_scale ? matrix.topLeftCorner<3, 1>().norm() : 1.0;
  if (!(scale > kMinScale)) return std::nullopt;
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>() / scale;
  return Sim3<World, World>(scale, Eigen::Quaterniond(rotation), matrix.topRightCorner<3, 1>());
}

Eigen::Quaterniond MeanRotation(std::span<const Eigen::Matrix3d> rotations) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const Eigen::Matrix3d& rotation : rotations) sum += rotation;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  const Eigen::Matrix3d mean = svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
  return Eigen::Quaterniond(mean);
}

Sim3<World, World> AlignMeans(const Points& x, const Points& y, const Eigen::Quaterniond& rotation) {
  const Eigen::Vector3d mean_x = AsMatrix(x).rowwise().mean();
  const Eigen::Vector3d mean_y = AsMatrix(y).rowwise().mean();
  return {1, rotation, mean_y - rotation * mean_x};
}

absl::StatusOr<PoseAssociation> AssociatePoses(std::span<const files::StampedPose> estimated,
                                               std::span<const files::StampedPose> ground_truth, double max_dt_s,
                                               size_t needed) {
  PoseAssociation pairs =
      files::AssociateTimestamps(TimestampsOf(estimated), TimestampsOf(ground_truth), std::llround(max_dt_s * 1e9));
  if (pairs.size() >= needed) return pairs;
  return InvalidArgument("only {} of {} estimated poses have a ground-truth pose within {:.3f} s; at least {} required",
                         pairs.size(), estimated.size(), max_dt_s, needed);
}

absl::StatusOr<TrajectoryFit> AlignTrajectories(std::span<const files::StampedPose> estimated,
                                                std::span<const files::StampedPose> ground_truth, Alignment alignment,
                                                double max_dt_s) {
  TrajectoryFit fit;
  ROMAP_ASSIGN_OR_RETURN(fit.pairs,
                         AssociatePoses(estimated, ground_truth, max_dt_s, alignment == Alignment::kNone ? 1 : 3));
  if (alignment == Alignment::kNone) return fit;
  Points x, y;
  for (const auto& [i, j] : fit.pairs) {
    x.push_back(estimated[i].T_world_camera.translation());
    y.push_back(ground_truth[j].T_world_camera.translation());
  }
  const std::optional<Sim3<World, World>> similarity = FitSimilarity(x, y, alignment == Alignment::kSim3);
  if (!similarity) {
    return InvalidArgument("cannot align the trajectories: all estimated or all true positions coincide");
  }
  fit.S_gt_est = *similarity;
  return fit;
}

std::optional<IcpResult> Icp(const Points& source, const Points& target, const IcpOptions& options) {
  const NearestIndex target_index(target);
  IcpResult result;
  result.rms = std::numeric_limits<double>::infinity();
  for (result.iterations = 1; result.iterations <= options.max_iterations; ++result.iterations) {
    const Neighbors nearest = target_index.Query(Transform(result.S_target_source, source));
    Points paired;
    paired.reserve(source.size());
    double squared_sum = 0;
    for (size_t k = 0; k < source.size(); ++k) {
      paired.push_back(target[nearest.index[k]]);
      squared_sum += nearest.distance[k] * nearest.distance[k];
    }
    const double rms = std::sqrt(squared_sum / static_cast<double>(source.size()));
    const bool converged = result.rms - rms < options.tolerance;
    result.rms = std::min(result.rms, rms);
    if (converged) return result;
    const std::optional<Sim3<World, World>> fit = FitSimilarity(source, paired, options.with_scale);
    if (!fit || fit->scale() <= 0.2 || fit->scale() >= 5) return std::nullopt;
    result.S_target_source = *fit;
  }
  result.iterations = options.max_iterations;
  return result;
}

}  // namespace romap::eval
