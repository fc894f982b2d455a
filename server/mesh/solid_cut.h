#pragma once

#include "common/field_snapshot.h"
#include "server/mesh/field_grid.h"

namespace romap::mesh {

// Fills cavities that too few views observe as empty. A minimum cut (Boykov and Kolmogorov 2004) through
// the nodes outside the surface weighs the area of the surface against the share of the views that observe each node as
// empty; see Lempitsky and Boykov 2007 and Vogiatzis et al. 2007 for surfaces as minimum cuts. A cavity that a few
// views observe through a pinhole is sealed, because the pinhole has a smaller area than the walls of the cavity; the
// inside of a cup, which many views observe, stays open. Space that no view observes is solid.
//
// Only space deeper than a few nodes behind the cut becomes solid. Above it the field defines the surface better than
// the cut, which rounds details. Nodes inside the surface and certainly empty nodes (kEmpty) stay.
//
// False if no depth image covers the space; the grid is unchanged then.
bool CutSolid(FieldGrid& grid, const FieldSnapshot& snapshot);

}  // namespace romap::mesh
