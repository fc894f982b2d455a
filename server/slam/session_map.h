#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/correction_log.h"
#include "server/slam/given_world.h"
#include "server/slam/local_map.h"
#include "server/slam/loop_detector.h"
#include "server/slam/map_initialization.h"
#include "server/slam/mask_voter.h"
#include "server/slam/observation_refiner.h"
#include "server/slam/place_recognizer.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"
#include "server/slam/uncertainty_estimator.h"
#include "server/slam/world_up.h"

namespace romap::slam {

// One map of a session, with everything that belongs to it alone. Its parts refer to each other, so it cannot be
// copied or moved. Not thread-safe.
struct SessionMap {
  // `keyframes_used`, `points_used`: ids used by earlier maps of the session.
  SessionMap(const SlamConfig& config, SparseMapId id, uint64_t keyframes_used, uint64_t points_used);
  SessionMap(const SessionMap&) = delete;
  SessionMap& operator=(const SessionMap&) = delete;

  bool IsEmpty() const { return map.points().empty(); }
  bool ScaleIsKnown() const { return has_depth_scale || world_is_given; }
  // Where a new map begins if the camera is lost now. This is a guess: the first pose continues the last known pose of
  // this map, and the scene is as far away as it was there.
  MapStart StartOfNextMap() const;
  // Takes over everything of `from`, which is in the same world and gets empty, except what depends on the place of the
  // camera. `has_camera`: the camera is in `from`, and that is taken over too.
  void Absorb(SessionMap& from, bool has_camera);
  // What the client should know about the accuracy of this map. If the client's poses define the world, that is only
  // whether up is right.
  std::vector<Diagnostic> Diagnostics() const;

  const SparseMapId id;
  SlamMap map;
  PlaceRecognizer places;
  LoopDetector loops;
  CorrectionLog corrections;
  WorldUp up;
  GivenWorld given_world;
  MaskVoter mask_voter;
  ObservationRefiner refiner;
  UncertaintyEstimator uncertainty;
  KeyframeId newest;
  KeyframeId reference;  // of the published local map: the newest keyframe, or where the camera was relocalized
  std::optional<LocalMap::Relocalization> relocalized = {};  // the newest one
  // The last tracked frame, see TrackedFrame.
  KeyframeId last_reference;
  SE3<Camera, Camera> T_reference_last;
  // Work on keyframes that has time until no new ones wait.
  std::deque<KeyframeId> unchecked = {};                                            // for loops
  std::deque<std::pair<KeyframeId, std::shared_ptr<const Frame>>> unsearched = {};  // for points by their patches
  Eigen::Vector3d given_up_world = Eigen::Vector3d::UnitZ();  // unit length; in a world of given poses
  bool given_up_is_estimated = false;
  std::optional<Diagnostic> given_up_contradiction = {};  // see CheckGivenUp()
  bool world_is_given = false;                            // the client's poses, given or as priors, define the world
  bool has_depth_scale = false;                           // depth images define the scale
  uint64_t next_global_adjustment;                        // number of keyframes at which it runs even without a loop
  double parallax_rad = 0;                                // see UpperParallax_rad(); as of the newest keyframe
};

// The parallax that a quarter of the map points exceed. A camera that moves forward sees most points from similar
// directions, but passes some at the side.
double UpperParallax_rad(const SlamMap& map);

}  // namespace romap::slam
