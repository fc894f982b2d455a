#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "common/field_snapshot.h"
#include "server/mesh/field_grid.h"
#include "server/mesh/surface_probe.h"

namespace romap::mesh {

struct SampledField {
  FieldGrid grid;
  size_t asked = 0;  // nodes at which the field was asked
};

// The field at the `box_nodes` nodes of a grid over the snapshot's box. Nodes outside the hull are empty (a hull of
// resolution 0 has no outside). What cannot be reached from there through space, over the six neighbours, is solid
// whatever the field says: a cavity of the object, or its inside, of which no colour ever told.
//
// The field is asked where it counts. First at a body-centred lattice: nodes whose three coordinates are all even or
// all odd, a quarter of all, at most 1.12 cells from any place. A node between six lattice nodes that are all clearly
// empty gets their mean. Then space is followed inwards from the hull: each node it reaches is asked, and the matter
// that bounds it; a node next to matter, or nearly matter, is never guessed. What is thinner than the lattice is thus
// found where it fades into its surroundings, and followed to its end where any of it was found.
SampledField SampleField(const FieldSnapshot& snapshot, const SurfaceProbe& probe, const Eigen::Vector3i& box_nodes);

}  // namespace romap::mesh
