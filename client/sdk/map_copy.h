#pragma once

#include <map>

#include "common/map_events.h"
#include "common/mapping_service.h"

namespace romap::client {

// A client's copy of a session's objects. Begun empty with a stream (Map or Watch) and given all its events in order,
// it holds the server's objects, the provisional ones included. A new stream tells of the objects there are, not of
// those that went meanwhile, so it takes a new copy.
class MapCopy {
 public:
  // Applies what an event says of objects; passes over all others, and a cuboid or a mesh that is older than what it
  // has.
  void Apply(const MapEvent& event);

  const std::map<ObjectId, ObjectSnapshot>& objects() const { return objects_; }

 private:
  std::map<ObjectId, ObjectSnapshot> objects_;
};

}  // namespace romap::client
