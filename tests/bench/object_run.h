#pragma once

// Runs tracker, sparse mapper and object mapper over a recorded sequence like a session, but in one thread and without
// training fields, so that equal options give equal maps.

#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "client/files/sequence.h"
#include "client/files/tum.h"
#include "common/client_input.h"
#include "common/map_events.h"
#include "common/status.h"
#include "server/objects/objects_config.h"
#include "server/slam/slam_config.h"
#include "tests/support/mask_damage.h"

namespace romap::measure {

struct ObjectRunOptions {
  slam::SlamConfig slam;
  objects::ObjectsConfig objects;
  PoseUse poses = PoseUse::kGiven;
  MaskDamage damage;
};

// The published data of one object.
struct PublishedObject {
  ObjectUpdate last;
  size_t updates = 0;         // ObjectUpdates published
  size_t first_frame = 0;     // index of the frame with the first update
  size_t views = 0;           // training views
  size_t cuboid_changes = 0;  // training boxes sent to its field
};

struct ObjectRun {
  std::map<ObjectId, PublishedObject> objects;  // in the final map, in any state
  std::vector<std::string> removals;            // one line per merged or removed object
  std::vector<files::StampedPose> trajectory;   // of the tracked frames, in the final map
  int frames = 0;
  int keyframes = 0;
  // User time of the object mapper.
  double frames_s = 0;
  double keyframes_s = 0;
  double slowest_keyframe_s = 0;

  std::vector<ObjectUpdate> Confirmed() const;
};

// Errors: those of Sequence::Load and of decoding frames.
absl::StatusOr<ObjectRun> RunObjects(const files::Sequence& sequence, const ObjectRunOptions& options);

}  // namespace romap::measure
