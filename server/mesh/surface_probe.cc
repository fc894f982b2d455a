#include "server/mesh/surface_probe.h"

#include <algorithm>
#include <cmath>

#include "server/mesh/field_grid.h"

namespace romap::mesh {
namespace {

// Larger than any trained value; keeps differences of values finite.
constexpr float kMaxValue = 1e4f;

}  // namespace

SurfaceProbe::SurfaceProbe(const FieldSnapshot& snapshot)
    : field_(*snapshot.field),
      level_(snapshot.surface_level),
      per_raw_(1.0f / snapshot.optics.raw_per_efold),
      connect_value_(std::clamp((snapshot.connect_level - level_) * per_raw_, -kMaxValue, 0.0f)) {}

void SurfaceProbe::Sample(std::span<const Eigen::Vector3f> points, std::span<float> values,
                          std::span<Rgb8> colors) const {
  field_.Sample(points, values, colors);
  for (float& value : values) {
    const float above = (value - level_) * per_raw_;
    value = std::isnan(above) ? kEmpty : std::clamp(above, kEmpty, kMaxValue);
  }
}

}  // namespace romap::mesh
