#pragma once

#include <vector>

#include "common/cuboid.h"
#include "common/field_snapshot.h"
#include "common/stage_messages.h"
#include "server/nerf/nerf_config.h"

namespace romap::bench {

// The visual hull of an object's masks as a field that needs no training; a baseline for the trained fields. Raw values
// are -10 at the centers of empty cells, which means fully transparent, and 10 at those of possibly occupied cells,
// with trilinear interpolation; the surface is at 0. FieldSnapshot::hull stays empty, so that the surface is not
// clipped along cells. At most 255 views, which must be valid (see ObjectField::AddView).
FieldSnapshot MakeHullSnapshot(const nerf::NerfConfig& config, const Cuboid& cuboid,
                               const std::vector<ObjectView>& views);

}  // namespace romap::bench
