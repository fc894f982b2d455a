#pragma once

#include "server/mesh/marching_cubes.h"
#include "server/mesh/surface_probe.h"

namespace romap::mesh {

// Moves vertices along their grid edges to the position where the field crosses the surface level, because the field
// between two nodes can be far from linear. Makes two steps of false position (the Illinois variant, Dowell and Jarratt
// 1971), each of which samples the field once per vertex. Vertices on edges to an edited node or to the ring stay, and
// no vertex leaves its edge.
void RefineVertices(const FieldGrid& grid, const SurfaceProbe& probe, GridSurface& surface);

}  // namespace romap::mesh
