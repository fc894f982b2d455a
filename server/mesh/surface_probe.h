#pragma once

#include <Eigen/Core>
#include <span>

#include "common/field_snapshot.h"

namespace romap::mesh {

// Samples a snapshot's field as the logarithm of the density over that at the surface, the unit that this folder uses.
// Only this class uses raw values. The snapshot must have a field and outlive the probe.
class SurfaceProbe {
 public:
  explicit SurfaceProbe(const FieldSnapshot& snapshot);

  // values[i] at points[i] (Object frame, map units): 0 on the surface, > 0 inside, always finite; NaN becomes kEmpty.
  // `colors` is empty (not needed) or as long as `points`.
  void Sample(std::span<const Eigen::Vector3f> points, std::span<float> values, std::span<Rgb8> colors = {}) const;

  // The value above which parts are connected (FieldSnapshot::connect_level), <= 0.
  float connect_value() const { return connect_value_; }

 private:
  const FieldSampler& field_;
  float level_;
  float per_raw_;
  float connect_value_;
};

}  // namespace romap::mesh
