#include "server/slam/geometry/up_fusion.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/angles.h"

namespace romap::slam {
namespace {

constexpr double kGuessSigma_rad = 45 * kRadPerDeg;
constexpr double kMaxUpTilt_rad = 75 * kRadPerDeg;
constexpr double kMaxSigma_rad = 5 * kRadPerDeg;
constexpr size_t kMaxClues = 10;
constexpr int kIterations = 6;
constexpr double kSameSigmas = 3;  // directions are about the same within this many standard deviations
constexpr double kMinSame_rad = 1 * kRadPerDeg;

// A set of clues that may be the right ones.
struct ClueSet {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
  double sigma_rad = kGuessSigma_rad;
  double weight = 0;  // probability, not normalized
  bool has_direction = false;
};

// Least squares over rotations of a direction: sums of residuals r with derivative J by the two angles about the
// tangents of the direction.
class TangentFit {
 public:
  explicit TangentFit(const Eigen::Vector3d& direction) : direction_(direction) {
    tangents_.col(0) = direction.unitOrthogonal();
    tangents_.col(1) = direction.cross(tangents_.col(0));
  }

  void AddDirection(const Eigen::Vector3d& target, double sigma_rad) {
    // The rotation that moves the direction to the target, along the tangents.
    const Eigen::Vector3d across = target - target.dot(direction_) * direction_;
    const double length = across.norm();
    const Eigen::Vector2d offset =
        length > 0 ? Eigen::Vector2d(AngleBetween(direction_, target) / length * tangents_.transpose() * across)
                   : Eigen::Vector2d::Zero();
    information_ += Eigen::Matrix2d::Identity() / (sigma_rad * sigma_rad);
    gradient_ += offset / (sigma_rad * sigma_rad);
    chi_squared_ += offset.squaredNorm() / (sigma_rad * sigma_rad);
  }

  void AddPerpendicular(const Eigen::Vector3d& normal, double sigma_rad) {
    const double residual = std::asin(std::clamp(normal.dot(direction_), -1.0, 1.0));
    const Eigen::Vector2d J = tangents_.transpose() * normal;
    information_ += J * J.transpose() / (sigma_rad * sigma_rad);
    gradient_ -= J * residual / (sigma_rad * sigma_rad);
    chi_squared_ += residual * residual / (sigma_rad * sigma_rad);
  }

  Eigen::Vector3d Step() const { return (direction_ + tangents_ * information_.ldlt().solve(gradient_)).normalized(); }
  double chi_squared() const { return chi_squared_; }
  const Eigen::Matrix2d& information() const { return information_; }

 private:
  Eigen::Vector3d direction_;
  Eigen::Matrix<double, 3, 2> tangents_;
  Eigen::Matrix2d information_ = Eigen::Matrix2d::Zero();
  Eigen::Vector2d gradient_ = Eigen::Vector2d::Zero();
  double chi_squared_ = 0;
};

TangentFit FitAt(const Eigen::Vector3d& direction, std::span<const UpClue> clues, uint32_t members,
                 const Eigen::Vector3d& guess) {
  TangentFit fit(direction);
  fit.AddDirection(guess, kGuessSigma_rad);
  for (size_t i = 0; i < clues.size(); ++i) {
    if ((members >> i & 1) == 0) continue;
    if (clues[i].kind == UpClue::Kind::kDirection) {
      fit.AddDirection(clues[i].vector_world, clues[i].sigma_rad);
    } else {
      fit.AddPerpendicular(clues[i].vector_world, clues[i].sigma_rad);
    }
  }
  return fit;
}

// The probability density of the right clues for the best direction, relative to that of clues that have nothing to do
// with up, which are distributed like the guess (Laplace's approximation of the integral over all directions).
ClueSet Evaluate(std::span<const UpClue> clues, uint32_t members, const Eigen::Vector3d& guess) {
  ClueSet set{.direction = guess};
  double log_weight = 0;
  int perpendicular = 0;
  for (size_t i = 0; i < clues.size(); ++i) {
    const double reliability = std::clamp(clues[i].reliability, 0.0, 0.999);
    if ((members >> i & 1) == 0) {
      log_weight += std::log(1 - reliability);
      continue;
    }
    log_weight += std::log(std::max(reliability, 1e-6));
    const double precision = kGuessSigma_rad / clues[i].sigma_rad;
    if (clues[i].kind == UpClue::Kind::kDirection) {
      if (!set.has_direction) set.direction = clues[i].vector_world;
      set.has_direction = true;
      log_weight += 2 * std::log(precision);
      // Of a clue without relation to up.
      log_weight += std::pow(AngleBetween(clues[i].vector_world, guess) / kGuessSigma_rad, 2) / 2;
    } else {
      ++perpendicular;
      log_weight += std::log(precision);
      const double tilt_rad = std::asin(std::clamp(clues[i].vector_world.dot(guess), -1.0, 1.0));
      log_weight += std::pow(tilt_rad / kGuessSigma_rad, 2) / 2;
    }
  }
  for (int i = 0; i < kIterations && members != 0; ++i) {
    set.direction = FitAt(set.direction, clues, members, guess).Step();
  }
  const TangentFit fit = FitAt(set.direction, clues, members, guess);
  const Eigen::Matrix2d covariance = fit.information().inverse();
  const double guess_variance = kGuessSigma_rad * kGuessSigma_rad;
  log_weight += std::log(std::sqrt(covariance.determinant()) / guess_variance) - fit.chi_squared() / 2;
  set.sigma_rad = std::sqrt(covariance.trace() / 2);
  // The line of intersection of two walls; that of nearly parallel walls is too uncertain.
  set.has_direction |= perpendicular >= 2 && set.sigma_rad < kMaxSigma_rad;
  const bool is_possible = AngleBetween(set.direction, guess) < kMaxUpTilt_rad;
  set.weight = is_possible ? std::exp(log_weight) : 0;
  return set;
}

}  // namespace

FusedUp FuseUp(std::span<const UpClue> clues, const Eigen::Vector3d& guess_world) {
  clues = clues.first(std::min(clues.size(), kMaxClues));
  std::vector<ClueSet> sets;
  double total = 0;
  for (uint32_t members = 0; members < 1U << clues.size(); ++members) {
    sets.push_back(Evaluate(clues, members, guess_world));
    total += sets.back().weight;
  }
  const ClueSet* best = &sets[0];
  for (const ClueSet& set : sets) {
    if (set.has_direction && (!best->has_direction || set.weight > best->weight)) best = &set;
  }
  FusedUp up{.direction_world = best->direction, .sigma_rad = best->sigma_rad, .confidence = 0};
  if (!best->has_direction) return up;
  const double same_rad = std::max(kMinSame_rad, kSameSigmas * best->sigma_rad);
  for (const ClueSet& set : sets) {
    const bool is_same = set.has_direction && AngleBetween(set.direction, best->direction) < same_rad;
    if (is_same) up.confidence += set.weight / total;
  }
  return up;
}

}  // namespace romap::slam
