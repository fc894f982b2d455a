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

// A decision and its reason, in words for logs and clients. A refusal has a reason too.
struct Decision {
  bool yes = false;
  const char* reason = "";
};

// A provisional landmark becomes an object: detected in most frames that should show it, in enough frames and
// keyframes, from different directions, with a cuboid of plausible proportions that its masks agree with.
Decision DecideConfirmation(const LandmarkEvidence& evidence, const LandmarkGeometry& geometry,
                            const ObjectsConfig& config);

// A provisional landmark is shown to clients before it is confirmed: it has a cuboid and a few observations.
Decision DecideAnnouncement(const LandmarkEvidence& evidence, const LandmarkGeometry& geometry);

// A confirmed object is lost: too many frames in a row should have shown it and did not.
Decision DecideLoss(ObjectState state, const LandmarkEvidence& evidence, const ObjectsConfig& config);

// A landmark is removed as a false detection. Confirmed objects never are. `frame_index` is that of the present frame.
Decision DecidePruning(ObjectState state, const LandmarkEvidence& evidence, bool has_cuboid, uint64_t frame_index,
                       const ObjectsConfig& config);

// The same at the end of the session: what is not confirmed then never will be.
Decision DecidePruningAtFinish(ObjectState state);

// How two landmarks appeared relative to each other.
struct CoVisibility {
  uint64_t together = 0;  // frames in which both had a mask
  uint64_t covered = 0;   // frames in which one had none and the mask of the other one covered it
};
CoVisibility CountCoVisibility(const Landmark& a, const Landmark& b);

// Two landmarks are one object: they occupy the same volume and were never detected side by side. A detector that
// splits objects shows one object as two at times; then one mask covers both in most frames.
Decision DecideMerge(const Landmark& a, const Landmark& b, const PointRegistry& points);

}  // namespace romap::objects
