#pragma once

#include <set>
#include <string>
#include <vector>

#include "common/map_events.h"

namespace romap::http {

// Restricts the events of a viewer to the objects of some classes. For the viewer, an object whose class leaves them is
// removed, and one whose class joins them is new.
class ClassFilter {
 public:
  // Empty: all classes.
  explicit ClassFilter(std::set<std::string> classes) : classes_(std::move(classes)) {}

  struct Result {
    std::vector<MapEvent> events;  // instead of the event: none or one
    ObjectId joined = {};          // its newest mesh should follow; 0: none
  };
  Result Apply(MapEvent event);

 private:
  Result ApplyUpdate(ObjectUpdate update);
  Result ApplyMerge(const ObjectMerged& merged);

  const std::set<std::string> classes_;
  std::set<ObjectId> shown_;
};

// "cup,book" as a set.
std::set<std::string> ParseClasses(const std::string& text);

}  // namespace romap::http
