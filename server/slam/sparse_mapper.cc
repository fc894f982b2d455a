#include "server/slam/sparse_mapper.h"

#include <spdlog/spdlog.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <utility>

#include "common/angles.h"
#include "common/statistics.h"
#include "server/slam/local_map_builder.h"
#include "server/slam/loop_closer.h"
#include "server/slam/map_culling.h"
#include "server/slam/map_initialization.h"

namespace romap::slam {
namespace {

// Tracking that is lost for this long in a map this small is unlikely to recover: the map is reset.
constexpr int kResetAfterLost_frames = 45;
constexpr size_t kMaxKeyframesToReset = 6;
constexpr uint64_t kFirstGlobalAdjustment_keyframes = 10;
constexpr uint64_t kGlobalPeriodWithPriors_keyframes = 5;
constexpr size_t kMinKeyframesToFindLens = 20;
constexpr double kMinParallax_rad = 3 * kRadPerDeg;
constexpr size_t kMaxPostponed = 60;  // keyframes, whose images are kept

bool HasPose(const TrackedFrame& tracked) {
  return tracked.state != TrackingState::kLost && tracked.state != TrackingState::kInitializing;
}

KeyframeView MakeView(const TrackedFrame& tracked, const MapKeyframe& keyframe, SlamMap& map) {
  KeyframeView view;
  view.id = keyframe.id;
  view.frame = tracked.frame;
  view.T_world_camera = keyframe.T_world_camera();
  view.up_world = tracked.up_world;
  for (size_t i = 0; i < keyframe.points.size(); ++i) {
    if (!keyframe.points[i]) continue;
    const Feature& feature = keyframe.features()[i];
    view.observations.push_back(
        {.point = keyframe.points[i], .pixel_px = keyframe.frame->image_px[i], .label = feature.label});
    view.points.push_back(map.FindPoint(keyframe.points[i])->point);
  }
  view.removed_points = map.TakeRemovedPoints();
  return view;
}

}  // namespace

SparseMapper::CurrentMap::CurrentMap(const SlamConfig& config, uint64_t keyframes_used, uint64_t points_used)
    : map(config, keyframes_used, points_used),
      places(config, &map),
      loops(config, &map, &places),
      up(keyframes_used),
      mask_voter(config),
      refiner(config),
      uncertainty(config),
      next_global_adjustment(keyframes_used + kFirstGlobalAdjustment_keyframes) {}

SparseMapper::SparseMapper(const SlamConfig& config, LocalMapSlot* local_map, Background background)
    : config_(config),
      background_(background),
      slot_(local_map),
      keyframe_builder_(config),
      local_adjuster_(config, /*run_inline=*/background != Background::kAllAdjustment),
      global_adjuster_(config, /*run_inline=*/background == Background::kNothing),
      loop_trial_(config, /*run_inline=*/background == Background::kNothing),
      current_(std::make_unique<CurrentMap>(config, 0, 0)) {}

MappedFrame SparseMapper::Process(const TrackedImage& image) {
  MappedFrame mapped{.tracked = image.tracked};
  const bool loop_was_closed = ConcludeLoopTrial(/*wait=*/false);
  bool was_adjusted = ApplyGlobalAdjustment(/*wait=*/false) || loop_was_closed;
  was_adjusted |= ApplyLocalAdjustment(/*wait=*/false);
  if (!image.tracked.is_keyframe) was_adjusted |= DoPostponedWork();
  const bool is_of_current_map = image.pose_given || image.generation == generation_;
  if (image.initial_views) {
    InitializeFrom(image, mapped);
  } else if (HasPose(image.tracked) && is_of_current_map) {
    MapTrackedFrame(image, mapped);
  } else if (HasPose(image.tracked)) {
    // The frame was tracked against a map that has since been reset.
    mapped.tracked.state = TrackingState::kLost;
    mapped.tracked.is_keyframe = false;
  } else if (image.tracked.state == TrackingState::kLost && is_of_current_map) {
    HandleLostFrame(image, mapped);
  }
  ReportCorrections(was_adjusted, mapped);
  return mapped;
}

void SparseMapper::ObserveMasks(const FrameMasks& masks) {
  if (!current_->world_is_given) current_->mask_voter.ObserveMasks(masks, current_->map);
}

MapCorrection SparseMapper::Finish() {
  ApplyLocalAdjustment(/*wait=*/true);
  if (!current_->unsearched.empty()) {
    SearchPoints(0);
    StartGlobalAdjustment();
    ApplyGlobalAdjustment(/*wait=*/true);
  }
  do {
    ConcludeLoopTrial(/*wait=*/true);
  } while (CheckNextLoop());
  ApplyGlobalAdjustment(/*wait=*/true);
  if (!current_->world_is_given && current_->map.keyframes().size() > 2) {
    StartGlobalAdjustment();
    ApplyGlobalAdjustment(/*wait=*/true);
    AlignWithUp(/*is_last=*/true);
    current_->uncertainty.RequestUpdate();
    UpdateUncertainties();
  }
  LogSummary();
  return TakeCorrection();
}

std::vector<SessionWarning> SparseMapper::Warnings() const {
  if (current_->world_is_given || current_->map.keyframes().empty()) return {};
  std::vector<SessionWarning> warnings = current_->up.Warnings();
  const double parallax_rad = current_->parallax_rad;
  if (!current_->has_depth_scale && parallax_rad < kMinParallax_rad) {
    warnings.push_back({.name = "translation_unobservable",
                        .text = fmt::format(
                            "the camera has rotated with hardly any translation: most of the map points were seen from "
                            "directions less than {:.1f} deg apart ({:.0f} deg needed), so distances and the scale of "
                            "the translation are not known; move the camera sideways, or send depth images",
                            parallax_rad / kRadPerDeg, kMinParallax_rad / kRadPerDeg)});
  }
  for (SessionWarning& warning : current_->given_world.Warnings()) warnings.push_back(std::move(warning));
  return warnings;
}

// The parallax that a quarter of the map points exceed. A camera that moves forward sees most points from similar
// directions, but passes some at the side.
double SparseMapper::UpperParallax_rad() const {
  std::vector<double> parallaxes_rad;
  for (const auto& [id, track] : current_->map.points()) parallaxes_rad.push_back(track.point.max_parallax_rad);
  return parallaxes_rad.empty() ? 0 : Quantile(std::move(parallaxes_rad), 0.75);
}

// ------------------------------------------------------------------------------------------------ steps of Process

void SparseMapper::ResetMap() {
  local_adjuster_.Reset();
  global_adjuster_.Cancel();
  loop_trial_.Cancel();
  // Ids are never reused within a session.
  current_ = std::make_unique<CurrentMap>(config_, current_->map.keyframe_count(), current_->map.point_count());
}

void SparseMapper::InitializeFrom(const TrackedImage& image, MappedFrame& mapped) {
  const Frame& frame = *image.tracked.frame;
  mapped.was_reset = !current_->map.keyframes().empty();
  counts_.resets += mapped.was_reset ? 1 : 0;
  ResetMap();
  ++generation_;
  current_->has_depth_scale = !image.initial_views->second;
  if (const auto newest = InitializeMap(*image.initial_views, frame, config_, current_->map)) {
    current_->newest = *newest;
    for (const auto& [id, keyframe] : current_->map.keyframes()) current_->places.Add(keyframe);
    AlignWithUp();
    UpdateUncertainties();
    spdlog::info("slam: map initialized at frame {} with {} points", frame.frame_id, points());
    mapped.tracked.state = TrackingState::kTracking;
    mapped.tracked.is_keyframe = true;
    mapped.tracked.reference = *newest;
    mapped.tracked.T_reference_camera = {};
    UpdatePose(mapped.tracked);
    mapped.view = MakeView(mapped.tracked, *current_->map.FindKeyframe(*newest), current_->map);
  } else {
    ResetMap();
  }
  PublishLocalMap(current_->newest);
}

void SparseMapper::MapTrackedFrame(const TrackedImage& image, MappedFrame& mapped) {
  current_->frames_lost = 0;
  if (!image.pose_given) UpdatePose(mapped.tracked);
  if (!current_->world_is_given) {
    current_->up.ObserveGravity(*image.tracked.frame, mapped.tracked.T_world_camera);
  }
  if (image.tracked.is_keyframe) {
    AddKeyframe(image, mapped);
  } else if (!current_->world_is_given) {
    current_->mask_voter.ObserveFrame(mapped.tracked, current_->map);
  }
}

void SparseMapper::HandleLostFrame(const TrackedImage& image, MappedFrame& mapped) {
  const size_t keyframes = current_->map.keyframes().size();
  ++current_->frames_lost;
  if (current_->frames_lost > kResetAfterLost_frames && keyframes <= kMaxKeyframesToReset &&
      !current_->world_is_given) {
    spdlog::info("slam: tracking lost with only {} keyframes; resetting the map", keyframes);
    ResetMap();
    ++counts_.resets;
    ++generation_;
    mapped.was_reset = true;
    PublishLocalMap({});
    return;
  }
  if (keyframes == 0) return;
  const auto found = current_->places.Relocalize(*image.features);
  if (!found) return;
  ++counts_.relocalizations;
  current_->relocalized =
      LocalMap::Relocalization{.frame_id = image.features->frame_id, .T_world_camera = found->T_world_camera};
  PublishLocalMap(found->keyframe);
}

void SparseMapper::ReportCorrections(bool map_moved, MappedFrame& mapped) {
  if (map_moved || mapped.view) {
    MapCorrection correction = TakeCorrection();
    if (!correction.keyframes.empty() || !correction.points.empty() || !correction.uncertainties.empty()) {
      mapped.correction = std::move(correction);
    }
  }
  if (mapped.view) {
    current_->parallax_rad = UpperParallax_rad();
    current_->corrections.Record(*mapped.view, current_->map.FindKeyframe(mapped.view->id)->scale);
  }
}

MapCorrection SparseMapper::TakeCorrection() {
  MapCorrection correction = current_->corrections.TakeCorrection(current_->map);
  if (current_->uncertainty.TakeChange()) correction.uncertainties = current_->corrections.Uncertainties(current_->map);
  return correction;
}

// ------------------------------------------------------------------------------------------------ keyframes

void SparseMapper::AddKeyframe(const TrackedImage& image, MappedFrame& mapped) {
  SlamMap& map = current_->map;
  if (map.keyframes().empty()) {
    ++generation_;
    // Only a frame with a given pose can be the first keyframe without initial views.
    current_->world_is_given = true;
  }
  MapKeyframe& keyframe =
      keyframe_builder_.Insert(image, mapped.tracked.T_world_camera, current_->newest, current_->world_is_given, map);
  keyframe.uncertainty = image.tracked.uncertainty.value_or(PoseUncertainty{});
  current_->newest = keyframe.id;
  mapped.tracked.reference = image.pose_given ? KeyframeId{} : keyframe.id;
  mapped.tracked.T_reference_camera = {};
  mapped.tracked.reference_uncertainty = {};
  const bool is_live = background_ == Background::kAllAdjustment && !keyframe.pose_given;
  if (is_live) {
    // A fast camera needs the new points in the next frame.
    keyframe_builder_.MakeFirstPoints(keyframe, map);
    if (config_.refine_observations) current_->refiner.ReadPatches(*image.tracked.frame, keyframe, map);
    PublishLocalMap(keyframe.id);
  }
  CompleteKeyframe(image, keyframe);
  if (!is_live) CheckNextLoop();
  AlignWithGivenPoses(image, keyframe);
  AlignWithUp();
  if (!is_live || !keyframes_wait_) UpdateUncertainties();
  PublishLocalMap(keyframe.id);

  mapped.view = MakeView(image.tracked, keyframe, map);
  mapped.tracked.T_world_camera = mapped.view->T_world_camera;
  mapped.view->up_world = mapped.tracked.up_world;
}

void SparseMapper::CompleteKeyframe(const TrackedImage& image, MapKeyframe& keyframe) {
  SlamMap& map = current_->map;
  keyframe_builder_.Complete(image, keyframe, map);
  if (!keyframe.pose_given && config_.refine_observations) {
    current_->refiner.Refine(*image.tracked.frame, keyframe, map);
    current_->unsearched.emplace_back(keyframe.id, image.tracked.frame);
    // The search takes as long as all other steps.
    SearchPoints(keyframes_wait_ ? kMaxPostponed : 0);
  }
  CullPoints(config_, map);
  if (!keyframe.pose_given) {
    local_adjuster_.Adjust(keyframe, map);
    for (const KeyframeId removed : CullKeyframes(config_, keyframe, map)) current_->places.Remove(removed);
  }
  current_->places.Add(keyframe);
  if (!keyframe.pose_given && !loop_trial_.IsPending()) current_->unchecked.push_back(keyframe.id);
}

// Returns whether the map changed.
bool SparseMapper::ApplyLocalAdjustment(bool wait) {
  if (!local_adjuster_.Apply(wait, current_->map)) return false;
  PublishLocalMap(current_->reference);
  return true;
}

// Searches more points in the keyframes where that was postponed, the oldest first, except the `keyframes_to_leave`
// newest.
void SparseMapper::SearchPoints(size_t keyframes_to_leave) {
  auto& unsearched = current_->unsearched;
  for (; unsearched.size() > keyframes_to_leave; unsearched.pop_front()) {
    MapKeyframe* keyframe = current_->map.FindKeyframe(unsearched.front().first);
    if (keyframe != nullptr) current_->refiner.Search(*unsearched.front().second, *keyframe, current_->map);
  }
}

// Live, while no keyframe waits: one piece of the work that was postponed. Returns whether the map changed.
bool SparseMapper::DoPostponedWork() {
  if (keyframes_wait_) return false;
  if (current_->unsearched.empty()) return CheckNextLoop();
  SearchPoints(current_->unsearched.size() - 1);
  return true;
}

// Checks the oldest keyframe that was not checked for loops. Returns whether there was one.
bool SparseMapper::CheckNextLoop() {
  if (current_->unchecked.empty() || loop_trial_.IsPending()) return false;
  const MapKeyframe* keyframe = current_->map.FindKeyframe(current_->unchecked.front());
  current_->unchecked.pop_front();
  if (keyframe != nullptr) CloseLoopOrAdjust(*keyframe);  // null: it was redundant
  return true;
}

void SparseMapper::CloseLoopOrAdjust(const MapKeyframe& keyframe) {
  CurrentMap& current = *current_;
  const bool scale_is_known = current.has_depth_scale || current.world_is_given;
  std::optional<LoopMatch> loop;
  if (config_.close_loops) loop = current.loops.Find(keyframe, scale_is_known);
  if (loop && loop->drift_px > kNoDrift_px) {
    global_adjuster_.Cancel();  // its result would undo the loop closure
    loop_trial_.Start(current.map, *loop, scale_is_known, CanEstimateLens());
    return;
  }
  if (loop) {
    local_adjuster_.Discard();
    CloseLoop(*loop, scale_is_known, config_, current.map);
    ++counts_.loops_merged;
    return;
  }
  if (current.map.keyframe_count() < current.next_global_adjustment) return;
  // Priors determine the scale of the whole map; local adjustment alone would adopt it too late.
  current.next_global_adjustment +=
      current.world_is_given ? kGlobalPeriodWithPriors_keyframes : current.next_global_adjustment;
  if (!global_adjuster_.IsPending()) StartGlobalAdjustment();
}

// ------------------------------------------------------------------------------------------------ the whole map

void SparseMapper::StartGlobalAdjustment() { global_adjuster_.Start(current_->map, CanEstimateLens()); }

// From few views, lens distortion cannot be separated from the shape of the scene. The client computed its poses with
// its own calibration.
bool SparseMapper::CanEstimateLens() const {
  return config_.refine_lens && !current_->world_is_given &&
         current_->map.keyframes().size() >= kMinKeyframesToFindLens;
}

bool SparseMapper::ApplyGlobalAdjustment(bool wait) {
  if (!global_adjuster_.Apply(wait, current_->map)) return false;
  local_adjuster_.Discard();
  current_->up.RequestUpdate();
  current_->uncertainty.RequestUpdate();
  if (current_->newest) PublishLocalMap(current_->reference);
  return true;
}

// Closes the loop on trial if the map confirms it. Returns whether the map changed.
bool SparseMapper::ConcludeLoopTrial(bool wait) {
  if (!loop_trial_.IsPending()) return false;
  const LoopTrial::Verdict verdict = loop_trial_.Conclude(wait, current_->map);
  if (verdict == LoopTrial::Verdict::kPending) return false;
  const bool closed = verdict == LoopTrial::Verdict::kClosed;
  if (closed) {
    local_adjuster_.Discard();
    ++counts_.loops_corrected;
    current_->up.RequestUpdate();
    current_->uncertainty.RequestUpdate();
    if (current_->newest) PublishLocalMap(current_->reference);
  } else {
    ++counts_.loops_rejected;
    current_->loops.Reject(loop_trial_.loop());
  }
  loop_trial_.Cancel();
  return closed;
}

void SparseMapper::AlignWithUp(bool is_last) {
  if (current_->world_is_given) return;
  const std::optional<Eigen::Quaterniond> R_new_old = current_->up.ProposeRotation(current_->map, is_last);
  if (!R_new_old) return;
  MoveMap({1.0, *R_new_old, Eigen::Vector3d::Zero()});
  current_->up.Rotate(*R_new_old);
}

// Poses that began after the map, whose world is another one.
void SparseMapper::AlignWithGivenPoses(const TrackedImage& image, const MapKeyframe& keyframe) {
  CurrentMap& current = *current_;
  if (!image.pose_ignored || current.world_is_given) return;
  current.given_world.Observe(keyframe.id, *image.tracked.frame->T_world_camera);
  const auto S_given_map = current.given_world.ProposeMotion(current.map, current.has_depth_scale);
  if (!S_given_map) return;
  MoveMap(*S_given_map);
  current.world_is_given = true;
}

void SparseMapper::MoveMap(const Sim3<World, World>& S_new_old) {
  current_->map.Transform(S_new_old);
  local_adjuster_.Move(S_new_old);
  global_adjuster_.Move(S_new_old);
  loop_trial_.Move(S_new_old);
}

void SparseMapper::UpdateUncertainties() {
  if (!current_->map.keyframes().begin()->second.pose_given) {
    current_->uncertainty.Update(CanEstimateLens(), current_->map);
  }
}

void SparseMapper::UpdatePose(TrackedFrame& tracked) const {
  const auto reference = current_->map.KeyframePose(tracked.reference);
  if (reference) tracked.T_world_camera = reference->Compose(tracked.T_reference_camera);
}

void SparseMapper::PublishLocalMap(KeyframeId reference) {
  current_->reference = reference;
  slot_->Put(MakeLocalMap(current_->map, reference, generation_, current_->relocalized));
}

void SparseMapper::LogSummary() const {
  const LocalAdjuster::Times& times = local_adjuster_.times();
  spdlog::info(
      "slam: {} keyframes, {} points; loops: {} corrected, {} merged without correction, {} rejected; {} "
      "relocalizations; {} map "
      "resets; up confidence {:.2f}; local bundle adjustment: mean {:.0f} ms, longest {:.0f} ms",
      current_->map.keyframes().size(), points(), counts_.loops_corrected, counts_.loops_merged, counts_.loops_rejected,
      counts_.relocalizations, counts_.resets, current_->up.confidence(), 1e3 * times.total_s / std::max(1, times.runs),
      1e3 * times.longest_s);
}

}  // namespace romap::slam
