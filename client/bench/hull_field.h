#pragma once

#include <vector>

#include "common/cuboid.h"
#include "common/field_snapshot.h"
#include "common/stage_messages.h"
#include "server/nerf/nerf_config.h"

namespace romap::bench {

// The visual hull of an object's masks as a field that needs no training: what is left when the learning is taken out.
// Raw values run from -10 in empty cells, which is clear as air to whoever asks what views see, to 10 in possible ones,
// trilinear between the cells' centres; the surface lies at 0, halfway. The snapshot takes no hull of its own, so that
// the surface is not cut along cells. The views must be valid (see ObjectField::AddView), at most 255.
FieldSnapshot MakeHullSnapshot(const nerf::NerfConfig& config, const Cuboid& cuboid,
                               const std::vector<ObjectView>& views);

}  // namespace romap::bench
