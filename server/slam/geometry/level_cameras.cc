#include "server/slam/geometry/level_cameras.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "common/angles.h"

namespace romap::slam {
namespace {

constexpr size_t kMinCameras = 4;
// Cameras that turned by less than this show the same sway of the hand, so they count as one sample.
constexpr double kSampleSpacing_rad = 10 * kRadPerDeg;
constexpr double kMaxSamples = 16;
constexpr double kMinSway_rad = 1.5 * kRadPerDeg;      // of the roll between samples; a steadier hand is luck
constexpr double kHabit_rad = 2 * kRadPerDeg;          // standard deviation of the constant part of the roll
constexpr double kMaxRoll_rad = 10 * kRadPerDeg;       // root mean square; beyond it, the cameras were not held level
constexpr double kMaxLevelTilt_rad = 75 * kRadPerDeg;  // of up from the mean of the cameras' own up axes
constexpr double kMaxLevelSigma_rad = 8 * kRadPerDeg;  // a vaguer result is no evidence
constexpr int kLevelIterations = 5;

double SampleCount(std::span<const Eigen::Vector3d> x_axes) {
  double samples = 1;
  Eigen::Vector3d last = x_axes[0];
  for (const Eigen::Vector3d& x : x_axes) {
    if (std::atan2(x.cross(last).norm(), x.dot(last)) < kSampleSpacing_rad) continue;
    last = x;
    samples += 1;
  }
  return std::min(samples, kMaxSamples);
}

struct RollFit {
  Eigen::Vector3d step = Eigen::Vector3d::Zero();         // of up: two tangent components; then the constant roll
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();  // of the same
  double roll_squared = 0;                                // mean
  double sway_squared = 0;                                // mean, after the step
};

// Linear least squares around `up`: the roll of a camera is x . up, which is a constant plus the sway of the hand.
RollFit FitRoll(std::span<const Eigen::Vector3d> x_axes, const Eigen::Vector3d& up,
                const Eigen::Matrix<double, 3, 2>& tangents, double sway_rad, double samples) {
  RollFit fit;
  const auto count = static_cast<double>(x_axes.size());
  const double weight = samples / count / (sway_rad * sway_rad);
  fit.information(2, 2) = 1 / (kHabit_rad * kHabit_rad);
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  const auto derivative = [&](const Eigen::Vector3d& x) {
    return Eigen::Vector3d(x.dot(tangents.col(0)), x.dot(tangents.col(1)), -1);
  };
  for (const Eigen::Vector3d& x : x_axes) {
    const Eigen::Vector3d J = derivative(x);
    fit.information += weight * J * J.transpose();
    gradient -= weight * J * x.dot(up);
    fit.roll_squared += x.dot(up) * x.dot(up) / count;
  }
  fit.step = fit.information.ldlt().solve(gradient);
  for (const Eigen::Vector3d& x : x_axes) {
    fit.sway_squared += std::pow(x.dot(up) + derivative(x).dot(fit.step), 2) / count;
  }
  return fit;
}

}  // namespace

std::optional<LevelUp> UpFromLevelCameras(std::span<const Eigen::Vector3d> x_axes_world,
                                          std::span<const Eigen::Vector3d> up_axes_world) {
  if (x_axes_world.size() < kMinCameras) return std::nullopt;
  Eigen::Vector3d mean_up = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& up : up_axes_world) mean_up += up;
  if (!mean_up.allFinite() || !(mean_up.norm() > 1e-3)) return std::nullopt;

  const double samples = SampleCount(x_axes_world);
  LevelUp level{.up_world = mean_up.normalized()};
  double sway_rad = kMinSway_rad;
  for (int i = 0; i < kLevelIterations; ++i) {
    Eigen::Matrix<double, 3, 2> tangents;
    tangents.col(0) = level.up_world.unitOrthogonal();
    tangents.col(1) = level.up_world.cross(tangents.col(0));
    const RollFit fit = FitRoll(x_axes_world, level.up_world, tangents, sway_rad, samples);
    if (!fit.step.allFinite()) return std::nullopt;
    level.up_world = (level.up_world + tangents * fit.step.head<2>()).normalized();
    // Three unknowns were fitted to the samples.
    const double degrees_of_freedom = std::max(1.0, samples - 3);
    sway_rad = std::max(kMinSway_rad, std::sqrt(fit.sway_squared * samples / degrees_of_freedom));
    level.roll_rad = std::sqrt(fit.roll_squared);
    level.sigma_rad = std::sqrt(fit.information.inverse().topLeftCorner<2, 2>().trace() / 2);
  }
  const bool is_level = level.roll_rad < kMaxRoll_rad && level.sigma_rad < kMaxLevelSigma_rad;
  const bool is_upright = level.up_world.dot(mean_up.normalized()) > std::cos(kMaxLevelTilt_rad);
  return is_level && is_upright ? std::optional(level) : std::nullopt;
}

}  // namespace romap::slam
