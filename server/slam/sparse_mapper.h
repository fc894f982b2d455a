#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "common/stage_messages.h"
#include "server/slam/correction_log.h"
#include "server/slam/features/feature_extractor.h"
#include "server/slam/local_map.h"
#include "server/slam/map_adjustment.h"
#include "server/slam/mask_voter.h"
#include "server/slam/place_recognizer.h"
#include "server/slam/point_maker.h"
#include "server/slam/slam_config.h"
#include "server/slam/slam_map.h"
#include "server/slam/tracker.h"
#include "server/slam/world_up.h"

namespace romap::slam {

// What became of one frame in the map.
struct MappedFrame {
  TrackedFrame tracked;                          // its pose in the world as it is now
  std::optional<MapCorrection> correction = {};  // of what was handed on before; comes before `view`
  std::optional<KeyframeView> view = {};         // of a keyframe
  bool was_reset = false;                        // all that was handed on before is void
};

// The mapping side of slam: makes the sparse map out of what tracking says, keeps it consistent (local and whole bundle
// adjustment, loops, gravity), finds lost cameras again, and hands the map around the camera to tracking. For one
// thread; only RequestEarlyStop() may be called from others.
//
// A point is tied to an object by the labels of its observations, one per keyframe that sees it. They are evidence, not
// verdicts: a label is 0 near a mask's border (see SlamConfig::mask_erosion_px) and in keyframes without masks, or
// whose masks have not come yet.
class SparseMapper {
 public:
  // `local_map` outlives the mapper. `inline_adjustment`: the whole bundle is adjusted on the spot and not on a thread
  // of its own, so that the same frames give the same map.
  SparseMapper(const SlamConfig& config, LocalMapSlot* local_map, bool inline_adjustment = false);
  ~SparseMapper();

  MappedFrame Process(const TrackedImage& image);
  // Masks of an earlier frame that had none, in the order of their frames. They tell which points lie on objects, which
  // is what WorldUp asks for; passed over when the frame is not known any more.
  void ObserveMasks(const FrameMasks& masks);
  // No more frames: waits for adjustments under way; what moved by them.
  MapCorrection Finish();
  // So many keyframes wait: bundle adjustment ends early.
  void RequestEarlyStop(bool keyframes_wait) { early_stop_requested_ = keyframes_wait; }

  size_t points() const { return map_->points().size(); }
  size_t keyframes() const { return map_->keyframe_count(); }
  const SlamMap& map() const { return *map_; }

  // Counts and times for benchmarks.
  struct Figures {
    std::vector<double> window_s;  // per local bundle adjustment
    int loops = 0;                 // closed with a correction
    int sewn = 0;                  // closed without one
    int relocalizations = 0;
    double up_confidence = 0;
  };
  const Figures& figures() const { return figures_; }

 private:
  struct GlobalAdjustment {
    MapProblem problem;
    BundleSummary summary;
    std::atomic<bool> abort = false;
    std::atomic<bool> done = false;
    std::thread thread;
  };

  void BeginAnew();
  bool Begin(const InitialViews& start, const Frame& frame);
  bool BeginFromTwoViews(const InitialViews& start, const SE3<World, Camera>& T_world_first);
  KeyframeView AddKeyframe(const TrackedImage& image);
  MapKeyframe& InsertKeyframe(const TrackedImage& image);
  void FindLostCamera(const TrackedImage& image);
  std::vector<KeyframeId> Neighborhood(const MapKeyframe& keyframe, size_t first, size_t second) const;
  std::vector<MapPointId> PointsOf(const std::vector<KeyframeId>& keyframes) const;
  void AdjustWindow(const MapKeyframe& keyframe);
  void CloseLoops(const MapKeyframe& keyframe);
  void StartGlobalAdjustment();
  bool MayFindLens() const;
  bool TakeGlobalAdjustment(bool wait);
  void DropGlobalAdjustment();
  bool TurnUp(bool is_last = false);
  void PublishLocalMap(KeyframeId around, std::optional<LocalMap::Relocalization> relocalized = {});
  KeyframeView MakeView(const TrackedFrame& tracked, const MapKeyframe& keyframe);
  void Place(TrackedFrame& tracked) const;

  const SlamConfig config_;
  LocalMapSlot* const slot_;
  const bool inline_adjustment_;
  FeatureExtractor extractor_;
  std::unique_ptr<SlamMap> map_;
  std::unique_ptr<PointMaker> maker_;
  std::unique_ptr<PlaceRecognizer> places_;
  CorrectionLog corrections_;
  WorldUp up_;
  MaskVoter mask_voter_;
  std::unique_ptr<GlobalAdjustment> whole_;
  Figures figures_;

  int generation_ = 0;
  bool world_is_given_ = false;
  bool metric_ = false;  // depth gives the scale
  KeyframeId latest_;
  uint64_t next_whole_ = 10;  // keyframes at which the whole bundle is adjusted, loop or not
  int frames_lost_ = 0;
  bool window_was_cut_short_ = false;
  std::atomic<bool> early_stop_requested_ = false;
};

}  // namespace romap::slam
