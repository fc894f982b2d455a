#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <vector>

#include "common/map_events.h"

namespace romap::client {

// The objects that the events of a stream announced, with their newest revision.
class SeenObjects {
 public:
  void Note(const MapEvent& event);
  // A new stream begins, whose server has only `existing` objects. Returns the removals of the others.
  std::vector<ObjectRemoved> KeepOnly(const std::vector<ObjectId>& existing);

 private:
  std::map<ObjectId, uint64_t> revisions_;
};

}  // namespace romap::client
