#pragma once

#include <atomic>
#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/correction_log.h"
#include "server/slam/given_world.h"
#include "server/slam/global_adjuster.h"
#include "server/slam/keyframe_builder.h"
#include "server/slam/local_adjuster.h"
#include "server/slam/local_map.h"
#include "server/slam/loop_detector.h"
#include "server/slam/loop_trial.h"
#include "server/slam/mask_voter.h"
#include "server/slam/observation_refiner.h"
#include "server/slam/place_recognizer.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"
#include "server/slam/tracker.h"
#include "server/slam/uncertainty_estimator.h"
#include "server/slam/world_up.h"

namespace romap::slam {

// The result of mapping one frame.
struct MappedFrame {
  TrackedFrame tracked;                          // with its pose in the current world
  std::optional<MapCorrection> correction = {};  // of earlier results; apply it before `view`
  std::optional<KeyframeView> view = {};         // only for a keyframe
  bool was_reset = false;                        // all earlier results are invalid; apply it before the other fields
};

// The mapping half of slam: builds the sparse map from tracked frames, keeps it consistent (local and global bundle
// adjustment, loop closing, gravity), relocalizes a lost camera, and publishes the part of the map around the camera
// for tracking. Not thread-safe, except SetKeyframesWait().
//
// The labels of a point's observations, one per keyframe that observes it, indicate which object it lies on. Single
// labels are not reliable: a label is 0 near a mask's border (see SlamConfig::mask_erosion_px) and in keyframes without
// masks or whose masks have not arrived.
class SparseMapper {
 public:
  // What runs on background threads instead of inside Process().
  enum class Background {
    kNothing,           // the same frames give the same map
    kGlobalAdjustment,  // of the whole map; the result of Process() is final for the newest keyframes
    kAllAdjustment,     // the fastest; a new keyframe is published before it is adjusted
  };

  // `local_map` outlives the mapper.
  SparseMapper(const SlamConfig& config, LocalMapSlot* local_map,
               Background background = Background::kGlobalAdjustment);

  MappedFrame Process(const TrackedImage& image);
  // Masks that arrive after their frame, in the order of their frames. They show which points lie on objects, which
  // WorldUp requires. Ignored if the frame is no longer stored.
  void ObserveMasks(const FrameMasks& masks);
  // Call after the last frame. Runs a final global adjustment and returns the resulting correction.
  MapCorrection Finish();
  // From any thread, live: whether keyframes wait to be mapped. Work that is not urgent is postponed meanwhile.
  void SetKeyframesWait(bool wait) { keyframes_wait_ = wait; }

  size_t points() const { return current_->map.points().size(); }
  // What the client should know about the accuracy of the map. Empty while there is no map.
  std::vector<SessionWarning> Warnings() const;

 private:
  friend class SparseMapperInspector;  // tests/support

  // Everything that a reset discards.
  struct CurrentMap {
    CurrentMap(const SlamConfig& config, uint64_t keyframes_used, uint64_t points_used);

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
    // Work on keyframes that has time until no new ones wait.
    std::deque<KeyframeId> unchecked = {};                                            // for loops
    std::deque<std::pair<KeyframeId, std::shared_ptr<const Frame>>> unsearched = {};  // for points by their patches
    bool world_is_given = false;      // the client's poses, given or as priors, define the world
    bool has_depth_scale = false;     // depth images define the scale
    uint64_t next_global_adjustment;  // number of keyframes at which it runs even without a loop
    double parallax_rad = 0;          // see UpperParallax_rad(); as of the newest keyframe
    int frames_lost = 0;              // in a row
  };

  // Counts over the whole session, logged at its end.
  struct Counts {
    int loops_corrected = 0;
    int loops_rejected = 0;  // contradicted by the rest of the map
    int loops_merged = 0;    // closed without moving poses, because the map had not drifted
    int relocalizations = 0;
    int resets = 0;
  };

  double UpperParallax_rad() const;
  void ResetMap();
  void InitializeFrom(const TrackedImage& image, MappedFrame& mapped);
  void MapTrackedFrame(const TrackedImage& image, MappedFrame& mapped);
  void HandleLostFrame(const TrackedImage& image, MappedFrame& mapped);
  void ReportCorrections(bool map_moved, MappedFrame& mapped);

  void AddKeyframe(const TrackedImage& image, MappedFrame& mapped);
  void CloseLoopOrAdjust(const MapKeyframe& keyframe);
  void CompleteKeyframe(const TrackedImage& image, MapKeyframe& keyframe);
  void SearchPoints(size_t keyframes_to_leave);
  bool CheckNextLoop();
  bool DoPostponedWork();
  bool ApplyLocalAdjustment(bool wait);
  bool ConcludeLoopTrial(bool wait);
  void StartGlobalAdjustment();
  bool ApplyGlobalAdjustment(bool wait);
  bool CanEstimateLens() const;
  void AlignWithGivenPoses(const TrackedImage& image, const MapKeyframe& keyframe);
  void AlignWithUp(bool is_last = false);
  void MoveMap(const Sim3<World, World>& S_new_old);
  void UpdateUncertainties();
  MapCorrection TakeCorrection();
  void UpdatePose(TrackedFrame& tracked) const;
  void PublishLocalMap(KeyframeId reference);
  void LogSummary() const;

  const SlamConfig config_;
  const Background background_;
  std::atomic<bool> keyframes_wait_ = false;
  LocalMapSlot* const slot_;
  KeyframeBuilder keyframe_builder_;
  LocalAdjuster local_adjuster_;
  GlobalAdjuster global_adjuster_;
  LoopTrial loop_trial_;
  std::unique_ptr<CurrentMap> current_;
  int generation_ = 0;  // of the map; see LocalMap::generation
  Counts counts_;
};

}  // namespace romap::slam
