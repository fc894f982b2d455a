#pragma once

// The object mapper over a recorded sequence: tracking, sparse map and objects as a session runs them, but in one
// thread and without fields, so that the same options give the same map.

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

// What was told of one object.
struct ToldObject {
  ObjectUpdate last;
  size_t updates = 0;         // ObjectUpdates published
  size_t first_frame = 0;     // index in the sequence of the frame it was first told with
  size_t views = 0;           // training views
  size_t cuboid_changes = 0;  // cuboids handed to its field
};

struct ObjectRun {
  std::map<ObjectId, ToldObject> objects;      // those that are left at the end, in any state
  std::vector<std::string> gone;               // a line for each that was merged or removed
  std::vector<files::StampedPose> trajectory;  // of the frames that were tracked, as the map has them at the end
  int frames = 0;
  int keyframes = 0;
  // User time of the object mapper.
  double frames_s = 0;
  double keyframes_s = 0;
  double slowest_keyframe_s = 0;

  std::vector<ObjectUpdate> Confirmed() const;
};

// `sequence` hands out its own labels: the damage may permute them. Errors: what Sequence::Load and the decoding of
// frames say.
absl::StatusOr<ObjectRun> RunObjects(const files::Sequence& sequence, const ObjectRunOptions& options);

}  // namespace romap::measure
