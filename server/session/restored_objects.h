#pragma once

#include <map>
#include <vector>

#include "common/ids.h"
#include "common/map_events.h"

namespace romap::session {

// Finds the objects of a stored map in the map that was made again from the stored inputs. Threads make the second map
// differ slightly from the first one, and its ids may differ. Two objects are the same if their centers are closer than
// half of the smaller one's diagonal; among several, the nearest with the same class comes first. Returns the stored id
// by the id in the new map.
std::map<ObjectId, ObjectId> FindRestoredObjects(const std::vector<ObjectUpdate>& stored,
                                                 const std::vector<ObjectUpdate>& made_again);

}  // namespace romap::session
