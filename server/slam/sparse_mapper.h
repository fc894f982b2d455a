#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstddef>
#include <optional>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/global_adjuster.h"
#include "server/slam/keyframe_builder.h"
#include "server/slam/local_adjuster.h"
#include "server/slam/local_map.h"
#include "server/slam/loop_trial.h"
#include "server/slam/map_atlas.h"
#include "server/slam/map_merger.h"
#include "server/slam/point_positions.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"
#include "server/slam/tracker.h"

namespace romap::slam {

// What the client knows about up in the world of its poses, see SessionOptions.
struct GivenUp {
  std::optional<Eigen::Vector3d> direction_world = {};  // any length > 0; nullopt: z, or from gravity
  bool estimate = false;                                // without direction and gravity: from the images
};

// The result of mapping one frame.
struct MappedFrame {
  TrackedFrame tracked;                          // with its pose in the world of the current map
  std::optional<MapCorrection> correction = {};  // of earlier results; apply it before `view`
  std::optional<KeyframeView> view = {};         // only for a keyframe
};

// The mapping half of slam: builds the sparse map from tracked frames, keeps it consistent (local and global bundle
// adjustment, loop closing, gravity), relocalizes a lost camera, and publishes the part of the map around the camera
// for tracking. A camera that stays lost begins a new map (MapAtlas), which is merged with the earlier ones when they
// show a common place (MapMerger). Not thread-safe, except SetKeyframesWait().
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
  SparseMapper(const SlamConfig& config, LocalMapSlot* local_map, Background background = Background::kGlobalAdjustment,
               const GivenUp& given_up = {});

  MappedFrame Process(const TrackedImage& image);
  // Masks that arrive after their frame, in the order of their frames. They show which points lie on objects, which
  // WorldUp requires. Ignored if the frame is no longer stored.
  void ObserveMasks(const FrameMasks& masks);
  // Call after the last frame. Runs a final global adjustment and returns the resulting correction.
  MapCorrection Finish();
  // From any thread, live: whether keyframes wait to be mapped. Work that is not urgent is postponed meanwhile.
  void SetKeyframesWait(bool wait) { keyframes_wait_ = wait; }

  size_t points() const { return atlas_.points(); }
  // Of the current map, see PointPositions().
  std::vector<Eigen::Vector3f> CurrentPoints(size_t max_points) const {
    return PointPositions(current().map, max_points);
  }
  SparseMapId current_map() const { return current().id; }
  // What the client should know about the accuracy of the map. Empty while there is no map.
  std::vector<Diagnostic> Diagnostics() const;

 private:
  friend class SparseMapperInspector;  // tests/support

  // Counts over the whole session, logged at its end.
  struct Counts {
    int loops_corrected = 0;
    int loops_rejected = 0;  // contradicted by the rest of the map
    int loops_merged = 0;    // closed without moving poses, because the map had not drifted
    int relocalizations = 0;
    int maps_begun = 0;
    int maps_merged = 0;
  };

  Eigen::Vector3d UpWorld() const {
    return current().world_is_given ? current().given_up_world : Eigen::Vector3d::UnitZ();
  }
  SessionMap& current() { return atlas_.current(); }
  const SessionMap& current() const { return atlas_.current(); }

  void DiscardPoints();
  void InitializeFrom(const TrackedImage& image, MappedFrame& mapped);
  void MapTrackedFrame(const TrackedImage& image, MappedFrame& mapped);
  bool Relocalize(const FrameFeatures& frame);
  void SetAside();
  void FinishCurrentMap();
  std::optional<MapCorrection> TakeCorrection(bool of_all_maps);

  void AddKeyframe(const TrackedImage& image, MappedFrame& mapped);
  void CloseLoopOrAdjust(const MapKeyframe& keyframe);
  void CompleteKeyframe(const TrackedImage& image, MapKeyframe& keyframe);
  void SearchPoints(size_t keyframes_to_leave);
  bool CheckNextLoop();
  bool DoPostponedWork();
  bool ApplyLocalAdjustment(bool wait);
  bool ConcludeLoopTrial(bool wait);
  bool ConcludeMerge(bool wait);
  void StartGlobalAdjustment();
  bool ApplyGlobalAdjustment(bool wait);
  bool CanEstimateLens() const;
  void ObserveGivenPose(const TrackedImage& image, const TrackedFrame& tracked);
  void AlignWithGivenPoses();
  void AlignWithUp(bool is_last = false);
  void UpdateGivenUp(const Eigen::Vector3d& tracked_up_world, bool is_last = false);
  void MoveMap(const Sim3<World, World>& S_new_old);
  void UpdateUncertainties();
  void UpdatePose(TrackedFrame& tracked) const;
  void PublishLocalMap(KeyframeId reference);
  void LogSummary() const;

  const SlamConfig config_;
  const Background background_;
  const GivenUp given_up_;
  std::atomic<bool> keyframes_wait_ = false;
  LocalMapSlot* const slot_;
  KeyframeBuilder keyframe_builder_;
  LocalAdjuster local_adjuster_;
  GlobalAdjuster global_adjuster_;
  LoopTrial loop_trial_;
  MapAtlas atlas_;
  MapMerger merger_;
  std::vector<Diagnostic> tracking_diagnostics_;
  std::vector<MapMerge> merges_;  // not reported yet
  int generation_ = 0;            // see LocalMap::generation
  int maps_refused_ = 0;          // new ones, because the place of the camera was known, since it was tracked
  Counts counts_;
};

}  // namespace romap::slam
