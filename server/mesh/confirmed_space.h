#pragma once

#include <span>

#include "common/field_snapshot.h"
#include "server/mesh/field_grid.h"

namespace romap::mesh {

// Empties matter, and what surrounds it thinly, that too few views confirm: nodes where, of the views whose image holds
// the place, less than `least_share` show the object. Nodes that no image holds stay. `least_share` <= 0 empties
// nothing.
//
// Neither the hull nor training can do that: a view that shows another object says nothing of what is behind it, so
// space that lies behind neighbours in nearly all views is free for any density. It mostly lies along the walls of the
// box, and a true part of the object is shown by most views.
//
// Most objects have no such space. So views are first asked at every sixth node, and only where more than half of them
// show neither the object nor background there, each node is looked at. Of more than 32 views, 32 stand for all.
void EmptyUnconfirmed(std::span<const TrainingCamera> views, double least_share, FieldGrid& grid);

}  // namespace romap::mesh
