#pragma once

#include "client/cli/map_files.h"
#include "client/render/mesh_view.h"

namespace romap::cli {

// The mesh of an object as it is rendered, with id 1. A texture that cannot be decoded is not drawn. `entry` must
// outlive the result.
render::MeshInstance InstanceOf(const MapObject& entry);

}  // namespace romap::cli
