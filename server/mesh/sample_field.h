#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "common/field_snapshot.h"
#include "server/mesh/field_grid.h"
#include "server/mesh/surface_probe.h"

namespace romap::mesh {

struct SampledField {
  FieldGrid grid;
  size_t samples = 0;  // nodes at which the field was evaluated
};

// The field at the `box_nodes` nodes of a grid over the snapshot's box. Nodes outside the hull are empty (a hull of
// resolution 0 is the whole box). Space that cannot be reached from outside the hull over six neighbors is solid
// regardless of the field: it is a cavity or the inside of the object, which no training pixel constrains.
//
// The field is evaluated only near the surface. The first nodes to be evaluated form a body-centered lattice: the nodes
// whose three coordinates are all even or all odd, a quarter of all, at most 1.12 cells from any point. A node between
// six lattice nodes that are all clearly empty is assigned their mean. Then a flood fill through empty space starts at
// the border of the hull and evaluates each node that it reaches and the nodes that bound it. A node next to solid or
// nearly solid nodes is never interpolated. Parts thinner than the lattice spacing are therefore detected by the
// density around them and followed to their ends.
SampledField SampleField(const FieldSnapshot& snapshot, const SurfaceProbe& probe, const Eigen::Vector3i& box_nodes);

}  // namespace romap::mesh
