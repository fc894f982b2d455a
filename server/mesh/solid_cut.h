#pragma once

#include "common/field_snapshot.h"
#include "server/mesh/field_grid.h"

namespace romap::mesh {

// Makes cavities solid that too little evidence shows to be empty. A minimum cut (Boykov and Kolmogorov 2004) through
// the nodes outside the surface weighs the area of the surface against the share of the views that see each node to be
// empty; see Lempitsky and Boykov 2007 and Vogiatzis et al. 2007 for surfaces as minimum cuts. A cavity that a few
// views see through a pinhole is sealed, because the pinhole has a smaller area than the walls of the cavity; the
// inside of a cup, which many views see, stays open. Space that no view sees is solid.
//
// Only space deeper than a few nodes behind the cut becomes solid. Above it the field defines the surface better than
// the cut, which rounds details. Nodes inside the surface and certainly empty nodes (kEmpty) stay.
//
// False if no view knows anything about the space; the grid is unchanged then.
bool CutSolid(FieldGrid& grid, const FieldSnapshot& snapshot);

}  // namespace romap::mesh
