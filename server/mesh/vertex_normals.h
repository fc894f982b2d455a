#pragma once

#include "server/mesh/surface_probe.h"
#include "server/mesh/marching_cubes.h"

namespace romap {

// Sets unit normals: the mean of the adjoining triangles' normals, weighted by area.
void SetAreaNormals(Mesh& mesh);

// Sets unit normals against the gradient of the field around each vertex, from central differences over a grid cell.
// Where the field has nothing to say (edited nodes, the box's and the hull's faces) or contradicts the triangles by
// more than 60 degrees, the triangles' mean counts (see SetAreaNormals).
void SetFieldNormals(const FieldGrid& grid, const SurfaceProbe& probe, GridSurface& surface);

}  // namespace romap
