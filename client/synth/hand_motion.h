#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "client/synth/options.h"

namespace romap::synth {

// A smooth random function of time with values of about -1..1 that varies over `period`, in the unit of `time`.
double SmoothNoise(double time, double period, uint32_t seed);

// The rotation that RotationOptions describes. Times are in frames.
class RotationBursts {
 public:
  // Rotates during the frames 0..frames.
  RotationBursts(const RotationOptions& options, int frames, uint64_t seed);

  // Rotation of the camera relative to its pose without bursts; identity at and beyond the limits.
  Eigen::Quaterniond Rotation(double time) const;
  // Displacement of the camera; zero at and beyond the last frame.
  Eigen::Vector3d Sway_m(double time) const;

 private:
  struct Burst {
    double start = 0;
    double duration = 0;
    double amplitude_rad = 0;
    int axis = 0;  // of the camera
  };

  double frames_;
  double sway_m_;
  uint32_t seed_;
  std::vector<Burst> bursts_;
};

// The fast shake that SynthOptions::shake_deg and shake_mm describe. Times are in frames.
class Shake {
 public:
  explicit Shake(const SynthOptions& options);

  Eigen::Quaterniond Rotation(double time) const;
  Eigen::Vector3d Displacement_m(double time) const;

 private:
  uint32_t seed_;
  double angle_rad_ = 0;   // factor of the noise
  double distance_m_ = 0;  // factor of the noise
};

}  // namespace romap::synth
