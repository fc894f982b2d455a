#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "common/messages.h"
#include "server/mesh/field_grid.h"
#include "server/mesh/surface_probe.h"

namespace romap {

struct SampledField {
  FieldGrid grid;
  size_t asked = 0;  // nodes at which the field was asked
};

// The field at the `box_nodes` nodes of a grid over the snapshot's box. Nodes outside the hull are empty (a hull of
// resolution 0 has no outside). Of the others, a body-centred lattice is asked first: nodes whose three coordinates are
// all even or all odd, a quarter of all, at most 1.12 cells from any place. Where the six lattice nodes around another
// node all say clearly empty, or clearly full, that node gets their mean; else the field is asked. From there the
// surface is followed: a node next to matter, or nearly matter, is never guessed to be empty. What is thinner than the
// lattice is thus found where it fades into its surroundings, and to its end where any of it was found.
SampledField SampleField(const FieldSnapshot& snapshot, const SurfaceProbe& probe, const Eigen::Vector3i& box_nodes);

}  // namespace romap
