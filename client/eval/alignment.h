#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client/eval/points.h"
#include "client/files/tum.h"
#include "common/status.h"

namespace romap::eval {

enum class Alignment { kNone, kSe3, kSim3 };

// "none", "se3" or "sim3".
std::string ToString(Alignment alignment);

// y = scale * rotation * x + translation.
struct FittedSimilarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x) const { return scale * (rotation * x) + translation; }
  Points operator*(const Points& points) const;
  double RotationAngle_rad() const;
};

// Least-squares similarity (or rigid motion) that takes x[i] to y[i]: Umeyama, PAMI 1991. Same lengths. nullopt when
// there are no points or all of them coincide.
std::optional<FittedSimilarity> FitSimilarity(const Points& x, const Points& y, bool with_scale);

// How two trajectories were laid over each other.
struct TrajectoryFit {
  FittedSimilarity gt_from_est;                  // estimated world to ground-truth world
  std::vector<std::pair<size_t, size_t>> pairs;  // (estimated, true) poses that belong together, by time
};

// Pairs the poses of two trajectories (sorted by time) that lie at most max_dt_s apart, one to one, after adding
// offset_s to the estimated times, and aligns their positions. INVALID_ARGUMENT when fewer than three pairs (kNone:
// one) are left, or the positions coincide.
absl::StatusOr<TrajectoryFit> AlignTrajectories(std::span<const files::StampedPose> estimated,
                                                std::span<const files::StampedPose> ground_truth, Alignment alignment,
                                                double max_dt_s, double offset_s = 0);

struct IcpOptions {
  bool with_scale = true;
  double overlap = 1;  // share of the closest source points that count, 0..1
  int max_iterations = 200;
  double tolerance = 1e-7;  // stop when the rms distance falls by less
};

struct IcpResult {
  FittedSimilarity target_from_source;
  double rms = 0;  // distance of the pairs at the end, in the unit of the points
  int iterations = 0;
};

// Point-to-point ICP (Besl and McKay, PAMI 1992), from identity, with or without scale: each source point pulls to its
// nearest target point and, where `symmetric_target` is not empty, each of those points to its nearest source point.
// nullopt when the scale leaves 0.2..5: the shapes do not belong together.
std::optional<IcpResult> Icp(const Points& source, const Points& target, const Points& symmetric_target,
                             const IcpOptions& options);

}  // namespace romap::eval
