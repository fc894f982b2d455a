#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client/eval/points.h"
#include "client/files/tum.h"
#include "common/geometry.h"
#include "common/status.h"

namespace romap::eval {

enum class Alignment { kNone, kSe3, kSim3 };

// "none", "se3" or "sim3".
std::string ToString(Alignment alignment);

// The similarity of every point.
Points Transform(const Sim3<World, World>& similarity, const Points& points);

// Least-squares similarity (rigid transform without `with_scale`) that maps x[i] to y[i] (Umeyama, PAMI 1991). `x` and
// `y` have the same length. nullopt if there are no points, if all points of `x` coincide, or if the best scale is 0,
// e.g. because all points of `y` coincide.
std::optional<Sim3<World, World>> FitSimilarity(const Points& x, const Points& y, bool with_scale);

// The mean of rotation matrices with the least squared (chordal) distance to them. `rotations` must not be empty.
Eigen::Quaterniond MeanRotation(std::span<const Eigen::Matrix3d> rotations);

// The rigid transform with the given rotation that maps the mean of `x` to the mean of `y`. Neither may be empty.
Sim3<World, World> AlignMeans(const Points& x, const Points& y, const Eigen::Quaterniond& rotation);

using PoseAssociation = std::vector<std::pair<size_t, size_t>>;  // indices (estimated, true), in order of time

// Associates the poses of two trajectories (sorted by time) one to one within max_dt_s. INVALID_ARGUMENT: fewer than
// `needed` pairs.
absl::StatusOr<PoseAssociation> AssociatePoses(std::span<const files::StampedPose> estimated,
                                               std::span<const files::StampedPose> ground_truth, double max_dt_s,
                                               size_t needed);

// The alignment of two trajectories.
struct TrajectoryFit {
  Sim3<World, World> S_gt_est;  // maps the estimated world to the ground-truth world
  PoseAssociation pairs;
};

// Associates the poses of two trajectories and aligns the positions of the pairs. INVALID_ARGUMENT: fewer than three
// pairs (one pair for kNone), or the positions determine no alignment (FitSimilarity).
absl::StatusOr<TrajectoryFit> AlignTrajectories(std::span<const files::StampedPose> estimated,
                                                std::span<const files::StampedPose> ground_truth, Alignment alignment,
                                                double max_dt_s);

struct IcpOptions {
  bool with_scale = true;
  int max_iterations = 200;
  double tolerance = 1e-7;  // stop when the rms distance decreases by less
};

struct IcpResult {
  Sim3<World, World> S_target_source;
  double rms = 0;  // final distance of the pairs, in the unit of the points
  int iterations = 0;
};

// Point-to-point ICP (Besl and McKay, PAMI 1992), starting from identity, with or without scale. Pairs each source
// point with its nearest target point. nullopt if the scale leaves 0.2..5, i.e. the shapes do not match.
std::optional<IcpResult> Icp(const Points& source, const Points& target, const IcpOptions& options);

}  // namespace romap::eval
