#include "server/nerf/field_surface.h"

#include <cmath>

namespace romap::nerf {
namespace {

constexpr double kConnectMargin = 2;  // raw density below surface_level at which components are connected
// Box sides. Components of a signed-distance field are connected if the gap between them is less than twice as wide.
constexpr double kConnectDistance = 0.01;

}  // namespace

void DescribeSurface(const NerfConfig& config, const FieldModel& model, const TrainingBox& box,
                     FieldSnapshot& snapshot) {
  if (model.IsDistance()) {
    // The density follows the logistic distribution of signed_distance.h. For a ray perpendicular to the surface, the
    // density at the surface is half the sharpness.
    snapshot.surface_level = 0;
    snapshot.optics.surface_density_per_mu = static_cast<float>(0.5 * model.sharpness / box.unit_mu);
    snapshot.optics.raw_per_efold = 1 / (model.sharpness * kDistancePerRaw);
    snapshot.connect_level = static_cast<float>(-kConnectDistance / kDistancePerRaw);
    return;
  }
  snapshot.surface_level = static_cast<float>(config.surface_level);
  // The field's density is per unit of the box's Unit space.
  snapshot.optics.surface_density_per_mu = static_cast<float>(std::exp(config.surface_level) / box.unit_mu);
  snapshot.connect_level = static_cast<float>(config.surface_level - kConnectMargin);
}

}  // namespace romap::nerf
