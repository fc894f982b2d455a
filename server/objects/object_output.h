#pragma once

#include <utility>
#include <vector>

#include "common/map_events.h"
#include "common/stage_messages.h"

namespace romap::objects {

// Output of one call of the object mapper.
struct ObjectOutput {
  // ObjectUpdate, ObjectRemoved and ObjectMerged, in the order in which they happened. Their revisions are 0: the
  // session's map counts revisions, because meshes get theirs from the same counter.
  std::vector<MapEvent> events;
  // Updates for the fields of confirmed objects. Their cuboid is the training box, which contains the published cuboid.
  std::vector<ObjectViews> views;

  void Append(ObjectOutput&& later) {
    for (MapEvent& event : later.events) events.push_back(std::move(event));
    for (ObjectViews& object : later.views) views.push_back(std::move(object));
  }
};

}  // namespace romap::objects
