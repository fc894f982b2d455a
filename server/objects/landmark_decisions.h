#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "server/objects/landmark.h"
#include "server/objects/objects_config.h"
#include "server/objects/point_registry.h"

namespace romap::objects {

// The life-cycle decisions about landmarks, as pure functions of their evidence: confirm, lose, prune, merge.

// A decision and its reason, as text for logs and clients. Negative decisions have a reason too.
struct Decision {
  bool yes = false;
  const char* reason = "";
};

// Whether a provisional landmark becomes a confirmed object: it must be detected in most frames that should show it, in
// enough frames and keyframes and from different directions, and its cuboid must have plausible proportions and agree
// with its masks.
Decision DecideConfirmation(const LandmarkEvidence& evidence, const LandmarkGeometry& geometry,
                            const ObjectsConfig& config);

// Whether a provisional landmark is published to clients before it is confirmed: it must have a cuboid and a few
// observations.
Decision DecideAnnouncement(const LandmarkEvidence& evidence, const LandmarkGeometry& geometry);

// Whether a confirmed object is lost: since its last observation, too many frames that should show it had no detection
// of it.
Decision DecideLoss(ObjectState state, const LandmarkEvidence& evidence, const ObjectsConfig& config);

// Whether a landmark is removed as a false detection; never true for confirmed objects. `frame_index`: of the current
// frame.
Decision DecidePruning(ObjectState state, const LandmarkEvidence& evidence, bool has_cuboid, uint64_t frame_index,
                       const ObjectsConfig& config);

// Whether a landmark is removed at the end of the session: true for provisional landmarks, which can no longer be
// confirmed.
Decision DecidePruningAtFinish(ObjectState state);

// Counts of frames in which two landmarks were detected together, or one was covered by the other.
struct CoVisibility {
  uint64_t together = 0;  // frames in which both had a mask
  uint64_t covered = 0;   // frames in which one had none and the mask of the other one covered it
};
CoVisibility CountCoVisibility(const Landmark& a, const Landmark& b);

// Whether two landmarks are one object: they must occupy the same volume and must never have been detected side by
// side. Exception: a detector that splits an object sometimes gives it two masks, but in most frames one mask covers
// both landmarks.
Decision DecideMerge(const Landmark& a, const Landmark& b, const PointRegistry& points);

}  // namespace romap::objects
