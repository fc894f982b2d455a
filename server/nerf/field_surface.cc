#include "server/nerf/field_surface.h"

#include <cmath>

namespace romap::nerf {
namespace {

constexpr double kConnectMargin = 2;       // raw density: parts joined above surface_level - this are one piece
constexpr double kConnectDistance = 0.01;  // box sides: parts of a signed-distance field as near as twice this are one

}  // namespace

void DescribeSurface(const NerfConfig& config, const nerf::FieldModel& model, const TrainingBox& box,
                     FieldSnapshot& snapshot) {
  if (model.IsDistance()) {
    // Light falls off as the logistic distribution of signed_distance.h; head on, its density at the surface is half
    // its sharpness.
    snapshot.surface_level = 0;
    snapshot.optics.surface_density_per_mu = static_cast<float>(0.5 * model.sharpness / box.unit_mu);
    snapshot.optics.raw_per_efold = 1 / (model.sharpness * nerf::kDistancePerRaw);
    snapshot.connect_level = static_cast<float>(-kConnectDistance / nerf::kDistancePerRaw);
    return;
  }
  snapshot.surface_level = static_cast<float>(config.surface_level);
  // Training measures density per unit of the box's Unit space.
  snapshot.optics.surface_density_per_mu = static_cast<float>(std::exp(config.surface_level) / box.unit_mu);
  snapshot.connect_level = static_cast<float>(config.surface_level - kConnectMargin);
}

}  // namespace romap::nerf
