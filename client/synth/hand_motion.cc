#include "client/synth/hand_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/synth/noise.h"
#include "client/synth/random.h"
#include "common/angles.h"

namespace romap::synth {
namespace {

constexpr double kCycles = 2;  // oscillations per burst
constexpr double kShakePeriod = 12;

Eigen::Vector3d SmoothNoise3(double time, double period, uint32_t seed) {
  return {SmoothNoise(time, period, seed), SmoothNoise(time, period, seed + 10), SmoothNoise(time, period, seed + 20)};
}

Eigen::Quaterniond FromRotationVector(const Eigen::Vector3d& vector) {
  const double angle_rad = vector.norm();
  if (angle_rad == 0) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle_rad, vector / angle_rad));
}

Eigen::Vector3d ShakeNoise(double time, uint32_t seed) { return SmoothNoise3(time, kShakePeriod, seed); }

// The factor by which the noise has the given maximal step between consecutive frames. The noise of a short sequence
// may be slower.
double FactorForPeakStep(double peak_step, int frames, uint32_t seed) {
  constexpr int kMinFrames = 100;
  frames = std::max(frames, kMinFrames);
  double highest = 0;
  for (int i = 1; i < frames; ++i) highest = std::max(highest, (ShakeNoise(i, seed) - ShakeNoise(i - 1, seed)).norm());
  return highest > 0 ? peak_step / highest : 0;
}

}  // namespace

double SmoothNoise(double time, double period, uint32_t seed) {
  const Eigen::Vector3f along(static_cast<float>(time), 0.37F, 0.71F);
  return FractalNoise(along, static_cast<float>(period), 2, 0.4F, 1e-6F, seed);
}

RotationBursts::RotationBursts(const RotationOptions& options, int frames, uint64_t seed)
    : frames_(frames), sway_m_(1e-3 * options.sway_mm), seed_(static_cast<uint32_t>(Scramble(seed + 17))) {
  Random random(seed, 5);
  constexpr int kRollPitchYaw[] = {2, 0, 1};
  int axis = random.Below(3);
  for (double start = 0; frames_ - start >= 1;) {
    Burst burst;
    burst.start = start;
    burst.axis = kRollPitchYaw[axis++ % 3];
    // The angle a sin(2 pi n u) sin(pi u) at u = 0..1 has its steepest slope 2 pi n a at u = 1/2.
    const double slope = 2 * std::numbers::pi * kCycles;
    const double speed_rad = options.speed_deg * kRadPerDeg * random.Uniform(0.7, 1);
    const double amplitude_rad = options.range_deg * kRadPerDeg * random.Uniform(0.7, 1);
    burst.duration = std::min(slope * amplitude_rad / speed_rad, frames_ - start);
    burst.amplitude_rad = speed_rad * burst.duration / slope * (random.Chance(0.5) ? 1 : -1);
    bursts_.push_back(burst);
    start += burst.duration;
  }
}

Eigen::Quaterniond RotationBursts::Rotation(double time) const {
  for (const Burst& burst : bursts_) {
    const double share = (time - burst.start) / burst.duration;
    if (share < 0 || share >= 1) continue;
    const double window = std::sin(std::numbers::pi * share);
    Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
    rotation[burst.axis] = burst.amplitude_rad * window * std::sin(2 * std::numbers::pi * kCycles * share);
    // A hand does not rotate about one axis exactly.
    rotation[(burst.axis + 1) % 3] = 0.15 * burst.amplitude_rad * window * std::sin(3 * std::numbers::pi * share);
    return FromRotationVector(rotation);
  }
  return Eigen::Quaterniond::Identity();
}

Eigen::Vector3d RotationBursts::Sway_m(double time) const {
  constexpr double kPeriod = 40;
  constexpr double kFadeOut = 15;
  return sway_m_ * std::clamp((frames_ - time) / kFadeOut, 0.0, 1.0) * SmoothNoise3(time, kPeriod, seed_);
}

Shake::Shake(const SynthOptions& options) : seed_(static_cast<uint32_t>(Scramble(options.seed + 18))) {
  if (options.shake_deg > 0) angle_rad_ = FactorForPeakStep(options.shake_deg * kRadPerDeg, options.frames, seed_);
  if (options.shake_mm > 0) distance_m_ = FactorForPeakStep(1e-3 * options.shake_mm, options.frames, seed_ + 1);
}

Eigen::Quaterniond Shake::Rotation(double time) const {
  if (angle_rad_ == 0) return Eigen::Quaterniond::Identity();
  return FromRotationVector(angle_rad_ * ShakeNoise(time, seed_));
}

Eigen::Vector3d Shake::Displacement_m(double time) const {
  if (distance_m_ == 0) return Eigen::Vector3d::Zero();
  return distance_m_ * ShakeNoise(time, seed_ + 1);
}

}  // namespace romap::synth
