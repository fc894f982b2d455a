#include "server/slam/sparse_mapper.h"

#include <spdlog/spdlog.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <iterator>
#include <memory>
#include <utility>

#include "server/slam/given_up.h"
#include "server/slam/keyframe_view.h"
#include "server/slam/local_map_builder.h"
#include "server/slam/loop_closer.h"
#include "server/slam/map_culling.h"
#include "server/slam/map_initialization.h"

namespace romap::slam {
namespace {

constexpr uint64_t kGlobalPeriodWithPriors_keyframes = 5;
constexpr size_t kMinKeyframesToFindLens = 20;
constexpr int kMaxMapsRefused = 3;    // during one loss
constexpr size_t kMaxPostponed = 60;  // keyframes, whose images are kept

bool HasPose(const TrackedFrame& tracked) {
  return tracked.state != TrackingState::kLost && tracked.state != TrackingState::kInitializing;
}

}  // namespace

SparseMapper::SparseMapper(const SlamConfig& config, LocalMapSlot* local_map, Background background,
                           const GivenUp& given_up)
    : config_(config),
      background_(background),
      given_up_(given_up),
      slot_(local_map),
      keyframe_builder_(config),
      local_adjuster_(config, /*run_inline=*/background != Background::kAllAdjustment),
      global_adjuster_(config, /*run_inline=*/background == Background::kNothing),
      loop_trial_(config, /*run_inline=*/background == Background::kNothing),
      atlas_(config),
      merger_(config, /*run_inline=*/background == Background::kNothing) {}

MappedFrame SparseMapper::Process(const TrackedImage& image) {
  MappedFrame mapped{.tracked = image.tracked};
  tracking_diagnostics_ = image.diagnostics;
  if (image.discard_points) DiscardPoints();
  const int generation_before = generation_;
  const bool loop_was_closed = ConcludeLoopTrial(/*wait=*/false);
  const bool was_merged = ConcludeMerge(/*wait=*/false);
  bool was_adjusted = ApplyGlobalAdjustment(/*wait=*/false) || loop_was_closed || was_merged;
  was_adjusted |= ApplyLocalAdjustment(/*wait=*/false);
  if (!image.tracked.is_keyframe) was_adjusted |= DoPostponedWork();
  const bool is_of_current_map = image.pose_given || image.generation == generation_;
  if (image.initial_views) {
    InitializeFrom(image, mapped);
  } else if (HasPose(image.tracked) && is_of_current_map) {
    MapTrackedFrame(image, mapped);
  } else if (HasPose(image.tracked)) {
    // The frame was tracked against a map that is not the current one any more.
    mapped.tracked.state = TrackingState::kLost;
    mapped.tracked.is_keyframe = false;
  } else if (image.tracked.state == TrackingState::kLost && is_of_current_map && image.features) {
    if (!current().map.keyframes().empty()) Relocalize(*image.features);
  }
  if (HasPose(mapped.tracked)) mapped.tracked.map = current().id;
  if (was_adjusted || mapped.view) {
    // A map that is not the current one any more may have changed before.
    mapped.correction = TakeCorrection(/*of_all_maps=*/was_merged || generation_ != generation_before);
  }
  if (mapped.view) {
    current().parallax_rad = UpperParallax_rad(current().map);
    current().corrections.Record(*mapped.view, current().map.FindKeyframe(mapped.view->id)->scale);
  }
  return mapped;
}

void SparseMapper::DiscardPoints() {
  std::vector<MapPointId> discarded;
  for (const auto& [id, track] : current().map.points()) discarded.push_back(id);
  for (const MapPointId id : discarded) current().map.RemovePoint(id);
  if (current().reference) PublishLocalMap(current().reference);
}

std::vector<Diagnostic> SparseMapper::Diagnostics() const {
  std::vector<Diagnostic> diagnostics = atlas_.Diagnostics();
  diagnostics.insert(diagnostics.end(), tracking_diagnostics_.begin(), tracking_diagnostics_.end());
  return diagnostics;
}

void SparseMapper::ObserveMasks(const FrameMasks& masks) {
  if (!current().world_is_given) current().mask_voter.ObserveMasks(masks, current().map);
}

MapCorrection SparseMapper::Finish() {
  FinishCurrentMap();
  const SparseMapId last = current().id;
  std::vector<SparseMapId> kept;
  for (const auto& map : atlas_.kept()) kept.push_back(map->id);
  for (const SparseMapId id : kept) {
    if (atlas_.Find(id) == nullptr) continue;  // merged
    SetAside();
    atlas_.SwitchTo(id);
    FinishCurrentMap();
  }
  atlas_.SwitchTo(last);
  LogSummary();
  MapCorrection last_correction;
  last_correction.up_world = UpWorld();
  return TakeCorrection(/*of_all_maps=*/true).value_or(last_correction);
}

void SparseMapper::FinishCurrentMap() {
  ApplyLocalAdjustment(/*wait=*/true);
  if (!current().unsearched.empty()) {
    SearchPoints(0);
    StartGlobalAdjustment();
    ApplyGlobalAdjustment(/*wait=*/true);
  }
  do {
    ConcludeLoopTrial(/*wait=*/true);
    ConcludeMerge(/*wait=*/true);
  } while (CheckNextLoop());
  ApplyGlobalAdjustment(/*wait=*/true);
  if (!current().world_is_given && current().map.keyframes().size() > 2) {
    StartGlobalAdjustment();
    ApplyGlobalAdjustment(/*wait=*/true);
    AlignWithUp(/*is_last=*/true);
    current().uncertainty.RequestUpdate();
    UpdateUncertainties();
  }
  UpdateGivenUp(current().given_up_world, /*is_last=*/true);
}

// ------------------------------------------------------------------------------------------------ steps of Process

void SparseMapper::InitializeFrom(const TrackedImage& image, MappedFrame& mapped) {
  const Frame& frame = *image.tracked.frame;
  const InitialViews& views = *image.initial_views;
  const bool is_first = current().IsEmpty();
  if (!is_first && image.generation != generation_) return;  // the camera was found since
  ++generation_;
  // A known place needs no new map. But it is not known if tracking has failed there before.
  if (!is_first && maps_refused_ < kMaxMapsRefused && Relocalize(*image.features)) {
    ++maps_refused_;
    return;
  }
  std::unique_ptr<SessionMap> made = atlas_.MakeMap();
  made->has_depth_scale = !views.second;
  const MapStart start = is_first ? FirstMapStart(views, frame) : WithGravity(current().StartOfNextMap(), views, frame);
  const auto newest = InitializeMap(views, start, config_, made->map);
  if (!newest) {
    atlas_.Discard(std::move(made));
    PublishLocalMap(current().reference);
    return;
  }
  SetAside();
  atlas_.Begin(std::move(made));
  ++counts_.maps_begun;
  current().newest = *newest;
  for (const auto& [id, keyframe] : current().map.keyframes()) current().places.Add(keyframe);
  AlignWithUp();
  UpdateUncertainties();
  spdlog::info("slam: {} initialized at frame {} with {} points", current().id.ToString(), frame.frame_id,
               current().map.points().size());
  mapped.tracked.state = TrackingState::kTracking;
  mapped.tracked.is_keyframe = true;
  mapped.tracked.reference = *newest;
  mapped.tracked.T_reference_camera = {};
  UpdatePose(mapped.tracked);
  current().last_reference = *newest;
  mapped.view = MakeKeyframeView(mapped.tracked, *current().map.FindKeyframe(*newest), current().map);
  PublishLocalMap(*newest);
}

void SparseMapper::MapTrackedFrame(const TrackedImage& image, MappedFrame& mapped) {
  maps_refused_ = 0;
  if (!image.pose_given) UpdatePose(mapped.tracked);
  if (!current().world_is_given || given_up_.estimate) {
    current().up.ObserveGravity(*image.tracked.frame, mapped.tracked.T_world_camera);
  }
  if (image.tracked.is_keyframe) {
    AddKeyframe(image, mapped);
  } else if (!current().world_is_given) {
    current().mask_voter.ObserveFrame(mapped.tracked, current().map);
    if (current().given_world.NeedsPoseAt(image.tracked.frame->timestamp_ns)) ObserveGivenPose(image, mapped.tracked);
  }
  mapped.tracked.up_world = UpWorld();
  current().last_reference = mapped.tracked.reference;
  current().T_reference_last = mapped.tracked.T_reference_camera;
}

// Finds a lost camera in one of the maps, which becomes the current one.
bool SparseMapper::Relocalize(const FrameFeatures& frame) {
  const auto place = atlas_.Relocalize(frame);
  if (!place) return false;
  ++counts_.relocalizations;
  if (place->map != current().id) {
    spdlog::info("slam: the camera was found in {}; {} is kept aside", place->map.ToString(), current().id.ToString());
    SetAside();
    atlas_.SwitchTo(place->map);
    ++generation_;
  }
  current().relocalized =
      LocalMap::Relocalization{.frame_id = frame.frame_id, .T_world_camera = place->located.T_world_camera};
  PublishLocalMap(place->located.keyframe);
  return true;
}

// The current map will not be extended for now: ends the work on it.
void SparseMapper::SetAside() {
  ConcludeLoopTrial(/*wait=*/false);
  SearchPoints(0);
  local_adjuster_.Reset();
  global_adjuster_.Cancel();
  loop_trial_.Cancel();
  merger_.Forget();
}

// What changed since the last call, in the current map or in all of them. nullopt: nothing.
std::optional<MapCorrection> SparseMapper::TakeCorrection(bool of_all_maps) {
  MapCorrection correction = current().corrections.TakeCorrection(current().map);
  if (of_all_maps) {
    for (const auto& kept : atlas_.kept()) {
      MapCorrection other = kept->corrections.TakeCorrection(kept->map);
      std::move(other.keyframes.begin(), other.keyframes.end(), std::back_inserter(correction.keyframes));
      std::move(other.points.begin(), other.points.end(), std::back_inserter(correction.points));
    }
  }
  if (current().uncertainty.TakeChange()) {
    correction.uncertainties = current().corrections.Uncertainties(current().map);
  }
  correction.merged_maps = std::exchange(merges_, {});
  correction.up_world = UpWorld();
  const bool is_empty = correction.keyframes.empty() && correction.points.empty() && correction.merged_maps.empty() &&
                        correction.uncertainties.empty();
  return is_empty ? std::nullopt : std::optional(std::move(correction));
}

// ------------------------------------------------------------------------------------------------ keyframes

void SparseMapper::AddKeyframe(const TrackedImage& image, MappedFrame& mapped) {
  SlamMap& map = current().map;
  if (map.keyframes().empty()) {
    ++generation_;
    // Only a frame with a given pose can be the first keyframe without initial views.
    current().world_is_given = true;
  }
  MapKeyframe& keyframe =
      keyframe_builder_.Insert(image, mapped.tracked.T_world_camera, current().newest, current().world_is_given, map);
  keyframe.uncertainty = image.tracked.uncertainty.value_or(PoseUncertainty{});
  current().newest = keyframe.id;
  mapped.tracked.reference = image.pose_given ? KeyframeId{} : keyframe.id;
  mapped.tracked.T_reference_camera = {};
  mapped.tracked.reference_uncertainty = {};
  const bool is_live = background_ == Background::kAllAdjustment && !keyframe.pose_given;
  if (is_live) {
    // A fast camera needs the new points in the next frame.
    keyframe_builder_.MakeFirstPoints(keyframe, map);
    if (config_.refine_observations) current().refiner.ReadPatches(*image.tracked.frame, keyframe, map);
    PublishLocalMap(keyframe.id);
  }
  CompleteKeyframe(image, keyframe);
  if (!is_live) CheckNextLoop();
  ObserveGivenPose(image, mapped.tracked);
  AlignWithGivenPoses();
  AlignWithUp();
  UpdateGivenUp(image.tracked.up_world);
  mapped.tracked.up_world = UpWorld();
  if (!is_live || !keyframes_wait_) UpdateUncertainties();
  PublishLocalMap(keyframe.id);

  mapped.view = MakeKeyframeView(image.tracked, keyframe, map);
  mapped.tracked.T_world_camera = mapped.view->T_world_camera;
  mapped.view->up_world = mapped.tracked.up_world;
}

void SparseMapper::CompleteKeyframe(const TrackedImage& image, MapKeyframe& keyframe) {
  SlamMap& map = current().map;
  keyframe_builder_.Complete(image, keyframe, map);
  if (!keyframe.pose_given && config_.refine_observations) {
    current().refiner.Refine(*image.tracked.frame, keyframe, map);
    current().unsearched.emplace_back(keyframe.id, image.tracked.frame);
    // The search takes as long as all other steps.
    SearchPoints(keyframes_wait_ ? kMaxPostponed : 0);
  }
  CullPoints(config_, map);
  map.ConvertByDepth(keyframe);
  if (keyframe.frame->shutter) {
    for (const auto& [id, shared] : map.Covisible(keyframe, kMinSharedPoints))
      map.ConvertByDepth(*map.FindKeyframe(id));
  }
  if (!keyframe.pose_given) local_adjuster_.Adjust(keyframe, map);
  for (const KeyframeId removed : CullKeyframes(config_, keyframe, map)) current().places.Remove(removed);
  current().places.Add(keyframe);
  if (!keyframe.pose_given && !loop_trial_.IsPending()) current().unchecked.push_back(keyframe.id);
}

// Returns whether the map changed.
bool SparseMapper::ApplyLocalAdjustment(bool wait) {
  if (!local_adjuster_.Apply(wait, current().map)) return false;
  PublishLocalMap(current().reference);
  return true;
}

// Searches more points in the keyframes where that was postponed, the oldest first, except the `keyframes_to_leave`
// newest.
void SparseMapper::SearchPoints(size_t keyframes_to_leave) {
  auto& unsearched = current().unsearched;
  for (; unsearched.size() > keyframes_to_leave; unsearched.pop_front()) {
    MapKeyframe* keyframe = current().map.FindKeyframe(unsearched.front().first);
    if (keyframe != nullptr) current().refiner.Search(*unsearched.front().second, *keyframe, current().map);
  }
}

// Live, while no keyframe waits: one piece of the work that was postponed. Returns whether the map changed.
bool SparseMapper::DoPostponedWork() {
  if (keyframes_wait_) return false;
  if (current().unsearched.empty()) return CheckNextLoop();
  SearchPoints(current().unsearched.size() - 1);
  return true;
}

// Checks the oldest keyframe that was not checked for loops. Returns whether there was one.
bool SparseMapper::CheckNextLoop() {
  if (current().unchecked.empty() || loop_trial_.IsPending()) return false;
  const MapKeyframe* keyframe = current().map.FindKeyframe(current().unchecked.front());
  current().unchecked.pop_front();
  if (keyframe != nullptr) CloseLoopOrAdjust(*keyframe);  // null: it was redundant
  return true;
}

void SparseMapper::CloseLoopOrAdjust(const MapKeyframe& keyframe) {
  SessionMap& current = this->current();
  const bool scale_is_known = current.ScaleIsKnown();
  merger_.Observe(keyframe, atlas_);
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

void SparseMapper::StartGlobalAdjustment() {
  SlamMap& map = current().map;
  for (auto& [id, keyframe] : map.keyframes()) map.ConvertByDepth(keyframe);
  global_adjuster_.Start(map, CanEstimateLens());
}

// From few views, lens distortion cannot be separated from the shape of the scene. The client computed its poses with
// its own calibration.
bool SparseMapper::CanEstimateLens() const {
  return config_.refine_lens && !current().world_is_given &&
         current().map.keyframes().size() >= kMinKeyframesToFindLens;
}

bool SparseMapper::ApplyGlobalAdjustment(bool wait) {
  if (!global_adjuster_.Apply(wait, current().map)) return false;
  local_adjuster_.Discard();
  current().up.RequestUpdate();
  current().uncertainty.RequestUpdate();
  if (current().newest) PublishLocalMap(current().reference);
  return true;
}

// Closes the loop on trial if the map confirms it. Returns whether the map changed.
bool SparseMapper::ConcludeLoopTrial(bool wait) {
  if (!loop_trial_.IsPending()) return false;
  const LoopTrial::Verdict verdict = loop_trial_.Conclude(wait, current().map);
  if (verdict == LoopTrial::Verdict::kPending) return false;
  const bool closed = verdict == LoopTrial::Verdict::kClosed;
  if (closed) {
    local_adjuster_.Discard();
    ++counts_.loops_corrected;
    current().up.RequestUpdate();
    current().uncertainty.RequestUpdate();
    if (current().newest) PublishLocalMap(current().reference);
  } else {
    ++counts_.loops_rejected;
    current().loops.Reject(loop_trial_.loop());
  }
  loop_trial_.Cancel();
  return closed;
}

// Merges the current map with a kept one if the trial of the merge succeeds. Returns whether it was merged.
bool SparseMapper::ConcludeMerge(bool wait) {
  const std::optional<MapMerge> merge = merger_.Conclude(wait, atlas_);
  if (!merge) return false;
  merges_.push_back(*merge);
  ++counts_.maps_merged;
  local_adjuster_.Reset();
  loop_trial_.Cancel();
  StartGlobalAdjustment();
  PublishLocalMap(current().reference);
  return true;
}

void SparseMapper::AlignWithUp(bool is_last) {
  if (current().world_is_given) return;
  const std::optional<Eigen::Quaterniond> R_new_old = current().up.ProposeRotation(current().map, is_last);
  if (!R_new_old) return;
  MoveMap({1.0, *R_new_old, Eigen::Vector3d::Zero()});
  current().up.Rotate(*R_new_old);
}

// The world of the client's poses is not turned; what is up in it may be estimated from the same evidence.
void SparseMapper::UpdateGivenUp(const Eigen::Vector3d& tracked_up_world, bool is_last) {
  SessionMap& current = this->current();
  if (!current.world_is_given) return;
  if (given_up_.direction_world) {
    current.given_up_world = given_up_.direction_world->normalized();
  } else if (given_up_.estimate) {
    current.given_up_is_estimated = true;
    const MapKeyframe* newest = current.map.FindKeyframe(current.newest);
    if (newest != nullptr) current.up.Assume(newest->T_world_camera().rotation() * -Eigen::Vector3d::UnitY());
    current.up.ProposeRotation(current.map, is_last);
    current.given_up_world = current.up.up_world();
  } else {
    current.given_up_world = tracked_up_world;
  }
  if (current.given_up_is_estimated || tracked_up_world != Eigen::Vector3d::UnitZ()) return;  // gravity is right
  current.up.ProposeRotation(current.map, is_last);
  current.given_up_contradiction = CheckGivenUp(current.up, current.given_up_world);
}

// Poses that began after the map, whose world is another one.
void SparseMapper::ObserveGivenPose(const TrackedImage& image, const TrackedFrame& tracked) {
  if (!image.pose_ignored || current().world_is_given) return;
  current().given_world.Observe(tracked.frame->timestamp_ns, tracked.reference, tracked.T_reference_camera,
                                *tracked.frame->T_world_camera);
}

void SparseMapper::AlignWithGivenPoses() {
  SessionMap& current = this->current();
  if (current.world_is_given) return;
  const auto S_given_map = current.given_world.ProposeMotion(current.map, current.has_depth_scale);
  if (!S_given_map) return;
  MoveMap(*S_given_map);
  current.up.Rotate(S_given_map->rotation());
  current.world_is_given = true;
  current.uncertainty.RequestUpdate();
}

void SparseMapper::MoveMap(const Sim3<World, World>& S_new_old) {
  current().map.Transform(S_new_old);
  local_adjuster_.Move(S_new_old);
  global_adjuster_.Move(S_new_old);
  loop_trial_.Move(S_new_old);
}

void SparseMapper::UpdateUncertainties() {
  if (!current().map.keyframes().begin()->second.pose_given) {
    current().uncertainty.Update(CanEstimateLens(), current().map);
  }
}

void SparseMapper::UpdatePose(TrackedFrame& tracked) const {
  const auto reference = current().map.KeyframePose(tracked.reference);
  if (reference) tracked.T_world_camera = reference->Compose(tracked.T_reference_camera);
}

void SparseMapper::PublishLocalMap(KeyframeId reference) {
  current().reference = reference;
  slot_->Put(MakeLocalMap(current(), generation_));
}

void SparseMapper::LogSummary() const {
  const LocalAdjuster::Times& times = local_adjuster_.times();
  spdlog::info(
      "slam: {} keyframes, {} points; loops: {} corrected, {} merged without correction, {} rejected; {} "
      "relocalizations; maps: {} begun, {} merged, {} merges rejected; up confidence {:.2f}; local bundle adjustment: "
      "mean {:.0f} ms, longest {:.0f} ms",
      current().map.keyframes().size(), points(), counts_.loops_corrected, counts_.loops_merged, counts_.loops_rejected,
      counts_.relocalizations, counts_.maps_begun, counts_.maps_merged, merger_.rejected(), current().up.confidence(),
      1e3 * times.total_s / std::max(1, times.runs), 1e3 * times.longest_s);
}

}  // namespace romap::slam
