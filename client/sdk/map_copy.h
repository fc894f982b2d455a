#pragma once

#include <map>

#include "common/map_events.h"
#include "common/mapping_service.h"

namespace romap::client {

// A client-side copy of a session's objects, built from the events of one stream (MapStream or Watch).
//
// Start with an empty copy for each stream and apply all of its events in order. The copy then equals the server's set
// of objects, provisional objects included. Do not reuse a copy for a second stream: a new stream sends the existing
// objects but does not report objects that were removed in between.
//
// Not thread-safe.
class MapCopy {
 public:
  // Applies an event. Ignores events that do not concern objects, cuboids and meshes with an older revision than the
  // stored one, and meshes of unknown objects.
  void Apply(const MapEvent& event);

  // Cuboids are in the World frame, in map units. Meshes are Draco-encoded (see MeshUpdate).
  const std::map<ObjectId, ObjectSnapshot>& objects() const { return objects_; }

 private:
  std::map<ObjectId, ObjectSnapshot> objects_;
};

}  // namespace romap::client
