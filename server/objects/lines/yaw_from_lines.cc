#include "server/objects/lines/yaw_from_lines.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace romap::objects {
namespace {

constexpr double kQuarterTurn = std::numbers::pi / 2;
constexpr int kSamples = 45;  // of a quarter turn: finer than the narrowest kernel
constexpr double kSample_rad = kQuarterTurn / kSamples;
constexpr double kReach = 3;  // half width of the kernel, in standard deviations

// Score at each sampled yaw; sample i is yaw i * kSample_rad.
using Curve = std::array<double, kSamples>;

// Wraps an angle to [-pi/4, pi/4].
double WrapQuarter(double angle_rad) { return angle_rad - kQuarterTurn * std::round(angle_rad / kQuarterTurn); }

// The yaw of one segment.
struct Vote {
  double yaw_rad;
  double sigma_rad;
  double weight;
};

struct Ballot {
  std::vector<Vote> votes;
  std::vector<double> view_azimuths_rad;  // of the view of each vote
};

// The vote of a segment between two unit rays, all in the reference frame. nullopt when it may be a vertical edge or
// its plane is horizontal.
std::optional<Vote> VoteOf(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double noise_rad,
                           const LineYawOptions& options) {
  const Eigen::Vector3d cross = from.cross(to);
  const double length_rad = cross.norm();
  if (!(length_rad > 1e-6)) return std::nullopt;
  const Eigen::Vector3d normal = cross / length_rad;
  const Eigen::Vector3d middle = (from + to).normalized();
  // Sine of the angle in the image between the segment and the vertical through its middle.
  const double vertical_sin = std::abs(normal.z()) / std::hypot(middle.x(), middle.y());
  if (!(vertical_sin > std::sin(options.vertical_rad))) return std::nullopt;
  constexpr double kMinSteepness = 0.05;  // sine of the angle between the plane and the horizontal
  const double steepness = std::hypot(normal.x(), normal.y());
  if (steepness < kMinSteepness) return std::nullopt;
  const Eigen::Vector3d horizontal = Eigen::Vector3d(normal.y(), -normal.x(), 0) / steepness;
  // Errors propagated through normal . direction(yaw) = 0: rotation of the foreshortened segment, and tilt of `up`.
  const double turn_rad = std::numbers::sqrt2 * noise_rad / length_rad * horizontal.cross(middle).norm();
  const double tilt_rad = options.tilt_rad * normal.z();
  const double measured_rad = std::hypot(turn_rad, tilt_rad) / steepness;
  const double sigma_rad = std::hypot(measured_rad, options.spread_rad);
  return Vote{WrapQuarter(std::atan2(horizontal.y(), horizontal.x())), sigma_rad, length_rad / sigma_rad};
}

Ballot CollectVotes(const Eigen::Matrix3d& R_world_reference, std::span<const LineView> views,
                    const LineYawOptions& options) {
  Ballot ballot;
  for (const LineView& view : views) {
    const Eigen::Matrix3d R_reference_camera = R_world_reference.transpose() * view.R_world_camera;
    const double noise_rad = options.endpoint_noise_px / view.camera.fx_px;
    const auto ray = [&](const Eigen::Vector2d& p_px) -> Eigen::Vector3d {
      return (R_reference_camera * view.camera.Unproject(p_px.x(), p_px.y())).normalized();
    };
    Eigen::Vector3d view_direction = Eigen::Vector3d::Zero();
    for (const LineSegment& segment : view.segments) {
      const Eigen::Vector3d from = ray(segment.from_px);
      const Eigen::Vector3d to = ray(segment.to_px);
      view_direction += from + to;
      if (const auto vote = VoteOf(from, to, noise_rad, options)) ballot.votes.push_back(*vote);
    }
    ballot.view_azimuths_rad.resize(ballot.votes.size(), std::atan2(view_direction.y(), view_direction.x()));
  }
  return ballot;
}

// Adds the kernel of one vote. `yaw_rad` within half a turn of 0.
void AddKernel(double yaw_rad, double sigma_rad, double weight, Curve* curve) {
  const double center = WrapQuarter(yaw_rad) / kSample_rad + kSamples;  // positive, so that % wraps
  const double reach = std::min(kReach * sigma_rad / kSample_rad, kSamples / 2.0 - 1);
  const int last = static_cast<int>(center + reach);
  for (int i = static_cast<int>(std::ceil(center - reach)); i <= last; ++i) {
    const double x = (i - center) / reach;
    const double kernel = (1 - x * x) * (1 - x * x);
    (*curve)[static_cast<size_t>(i % kSamples)] += weight * kernel;
  }
}

// Newton's method with the weights of the biweight: converges to a zero of the derivative of the summed kernels.
double Refine(double yaw_rad, const std::vector<Vote>& votes) {
  constexpr int kIterations = 10;
  constexpr double kConverged_rad = 1e-6;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    double gradient = 0;
    double stiffness = 0;
    for (const Vote& vote : votes) {
      const double difference_rad = WrapQuarter(vote.yaw_rad - yaw_rad);
      const double x = difference_rad / (kReach * vote.sigma_rad);
      if (std::abs(x) >= 1) continue;
      const double weight = vote.weight / (vote.sigma_rad * vote.sigma_rad) * (1 - x * x);
      gradient += weight * difference_rad;
      stiffness += weight;
    }
    if (!(stiffness > 0)) break;
    const double step_rad = gradient / stiffness;
    yaw_rad += step_rad;
    if (std::abs(step_rad) < kConverged_rad) break;
  }
  return WrapQuarter(yaw_rad);
}

// The score at any yaw.
double ScoreAt(double yaw_rad, const std::vector<Vote>& votes) {
  double score = 0;
  for (const Vote& vote : votes) {
    const double x = WrapQuarter(vote.yaw_rad - yaw_rad) / (kReach * vote.sigma_rad);
    if (std::abs(x) < 1) score += vote.weight * (1 - x * x) * (1 - x * x);
  }
  return score;
}

// The highest score of a clearly different yaw than that of sample `best`.
double BestOther(const Curve& curve, int best) {
  constexpr int kNear = 6;  // samples on either side of `best` with about the same yaw
  double highest = 0;
  for (int i = kNear; i <= kSamples - kNear; ++i) {
    highest = std::max(highest, curve[static_cast<size_t>((best + i) % kSamples)]);
  }
  return highest;
}

// The highest score that occurs on both sides of 0, at the same distance.
double BestMirrored(const Curve& curve) {
  double highest = 0;
  for (size_t i = 0; i < kSamples; ++i)
    highest = std::max(highest, std::min(curve[i], curve[(kSamples - i) % kSamples]));
  return highest;
}

}  // namespace

std::optional<YawEstimate> YawFromLines(const Eigen::Matrix3d& R_world_reference, std::span<const LineView> views,
                                        const LineYawOptions& options) {
  const Ballot ballot = CollectVotes(R_world_reference, views, options);
  if (ballot.votes.empty()) return std::nullopt;
  double total = 0;
  double total_squared = 0;
  for (const Vote& vote : ballot.votes) {
    total += vote.weight;
    total_squared += vote.weight * vote.weight;
  }
  Curve by_yaw{};
  Curve by_yaw_in_view{};
  for (size_t i = 0; i < ballot.votes.size(); ++i) {
    const Vote& vote = ballot.votes[i];
    AddKernel(vote.yaw_rad, vote.sigma_rad, vote.weight / total, &by_yaw);
    AddKernel(vote.yaw_rad - ballot.view_azimuths_rad[i], vote.sigma_rad, vote.weight / total, &by_yaw_in_view);
  }
  const auto highest = std::max_element(by_yaw.begin(), by_yaw.end());
  const int best = static_cast<int>(highest - by_yaw.begin());
  YawEstimate estimate;
  estimate.yaw_rad = Refine(best * kSample_rad, ballot.votes);
  estimate.share = ScoreAt(estimate.yaw_rad, ballot.votes) / total;
  estimate.edges = static_cast<int>(ballot.votes.size());
  const double rival = std::max(BestOther(by_yaw, best), BestMirrored(by_yaw_in_view));
  const double effective_edges = total * total / total_squared;
  estimate.confidence =
      std::max(0.0, estimate.share - rival) * effective_edges / (effective_edges + options.half_edges);
  return estimate;
}

}  // namespace romap::objects
