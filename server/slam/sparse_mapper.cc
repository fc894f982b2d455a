#include "server/slam/sparse_mapper.h"

#include <spdlog/spdlog.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <set>
#include <utility>

#include "common/statistics.h"
#include "common/thread_priority.h"
#include "server/slam/loop_closer.h"
#include "server/slam/map_culling.h"

namespace romap::slam {
namespace {

constexpr int kMinSharedPoints = 15;
constexpr int kMaxWindowIterations = 8;  // of local bundle adjustment; it has converged by then
constexpr size_t kMaxLocalPoints = 8000;
constexpr size_t kPlacesTold = 60;       // keyframes whose place tracking learns, besides those around
constexpr int kGiveUpAfter_frames = 45;  // a camera lost so long in a map so young begins anew
constexpr size_t kYoungMap_keyframes = 6;
constexpr uint64_t kWholePeriodWithPriors_keyframes = 5;
constexpr size_t kKeyframesToFindLens = 20;
constexpr int kScarcePoints = 100;  // known points of a keyframe below which tracking is in danger
constexpr int kMinObservationsWellPlaced = 3;

double Seconds(std::chrono::steady_clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

}  // namespace

SparseMapper::SparseMapper(const SlamConfig& config, LocalMapSlot* local_map, bool inline_adjustment)
    : config_(config),
      slot_(local_map),
      inline_adjustment_(inline_adjustment),
      extractor_(config),
      mask_voter_(config) {
  BeginAnew();
}

SparseMapper::~SparseMapper() { DropGlobalAdjustment(); }

void SparseMapper::BeginAnew() {
  DropGlobalAdjustment();
  const uint64_t keyframes = map_ ? map_->keyframe_count() : 0;
  const uint64_t points = map_ ? map_->point_count() : 0;
  map_ = std::make_unique<SlamMap>(config_, keyframes, points);
  maker_ = std::make_unique<PointMaker>(config_, map_.get());
  places_ = std::make_unique<PlaceRecognizer>(config_, map_.get());
  corrections_.Forget();
  up_ = WorldUp(keyframes);
  mask_voter_.Forget();
  next_whole_ = keyframes + 10;
  latest_ = {};
  frames_lost_ = 0;
}

// ------------------------------------------------------------------------------------------------ a frame's life

MappedFrame SparseMapper::Process(const TrackedImage& image) {
  MappedFrame mapped{.tracked = image.tracked};
  bool moved = TakeGlobalAdjustment(/*wait=*/false);
  const bool lost = image.tracked.state == TrackingState::kLost;
  const bool tracked = !lost && image.tracked.state != TrackingState::kInitializing;
  const bool fits = image.pose_given || image.generation == generation_;
  if (image.initial_views) {
    mapped.was_reset = !map_->keyframes().empty();
    if (Begin(*image.initial_views, *image.tracked.frame)) {
      mapped.tracked.state = TrackingState::kTracking;
      mapped.tracked.is_keyframe = true;
      mapped.tracked.reference = latest_;
      mapped.tracked.T_reference_camera = {};
      Place(mapped.tracked);
      mapped.view = MakeView(mapped.tracked, *map_->FindKeyframe(latest_));
    }
    PublishLocalMap(latest_);
  } else if (tracked && !fits) {
    // Tracked against a map that was given up meanwhile.
    mapped.tracked.state = TrackingState::kLost;
    mapped.tracked.is_keyframe = false;
  } else if (tracked) {
    frames_lost_ = 0;
    if (!image.pose_given) Place(mapped.tracked);
    if (!world_is_given_) up_.Observe(*image.tracked.frame, mapped.tracked.T_world_camera);
    if (image.tracked.is_keyframe) {
      mapped.view = AddKeyframe(image);
      mapped.tracked.T_world_camera = mapped.view->T_world_camera;
      mapped.tracked.reference = image.pose_given ? KeyframeId{} : mapped.view->id;
      mapped.tracked.T_reference_camera = {};
      mapped.view->up_world = mapped.tracked.up_world;
      moved = true;
    } else if (!world_is_given_) {
      mask_voter_.ObserveFrame(mapped.tracked, *map_);
    }
  } else if (lost && fits) {
    ++frames_lost_;
    if (frames_lost_ > kGiveUpAfter_frames && map_->keyframes().size() <= kYoungMap_keyframes && !world_is_given_) {
      spdlog::info("slam: the camera is lost in a map of {} keyframes, it is begun anew", map_->keyframes().size());
      BeginAnew();
      ++generation_;
      mapped.was_reset = true;
      PublishLocalMap({});
      return mapped;
    }
    FindLostCamera(image);
  }
  if (moved) {
    MapCorrection correction = corrections_.Take(*map_);
    if (!correction.keyframes.empty() || !correction.points.empty()) mapped.correction = std::move(correction);
  }
  if (mapped.view) corrections_.Tell(*mapped.view, map_->FindKeyframe(mapped.view->id)->scale);
  return mapped;
}

void SparseMapper::ObserveMasks(const FrameMasks& masks) {
  if (!world_is_given_) mask_voter_.ObserveMasks(masks, *map_);
}

MapCorrection SparseMapper::Finish() {
  TakeGlobalAdjustment(/*wait=*/true);
  if (!world_is_given_ && map_->keyframes().size() > 2) {
    StartGlobalAdjustment();
    TakeGlobalAdjustment(/*wait=*/true);
    TurnUp(/*is_last=*/true);
  }
  return corrections_.Take(*map_);
}

// The frame's pose in the world as it is now.
void SparseMapper::Place(TrackedFrame& tracked) const {
  const auto reference = map_->KeyframePose(tracked.reference);
  if (reference) tracked.T_world_camera = reference->Compose(tracked.T_reference_camera);
}

// ------------------------------------------------------------------------------------------------ the first views

bool SparseMapper::Begin(const InitialViews& start, const Frame& frame) {
  BeginAnew();
  ++generation_;
  world_is_given_ = false;
  metric_ = !start.second;
  // Until more is known the camera's own up is up, or what its gravity says.
  Eigen::Vector3d up_camera = -Eigen::Vector3d::UnitY();
  if (frame.gravity_camera && metric_) up_camera = -*frame.gravity_camera;
  const SE3<World, Camera> T_world_first(RotationFromZTo(up_camera).conjugate(), Eigen::Vector3d::Zero());
  if (start.second) {
    if (!BeginFromTwoViews(start, T_world_first)) {
      BeginAnew();
      return false;
    }
  } else {
    MapKeyframe& first = map_->AddKeyframe(start.first, T_world_first);
    maker_->MakePointsByDepth(first);
    latest_ = first.id;
  }
  for (const auto& [id, keyframe] : map_->keyframes()) places_->Add(keyframe);
  TurnUp();
  spdlog::info("slam: a map begins at frame {} with {} points", frame.frame_id, map_->points().size());
  return true;
}

bool SparseMapper::BeginFromTwoViews(const InitialViews& start, const SE3<World, Camera>& T_world_first) {
  constexpr size_t kMinPoints = 40;
  constexpr double kMaxRms_px = 2;
  if (start.points.size() < kMinPoints) return false;
  std::vector<double> depths;
  for (const InitialViews::Point& point : start.points) depths.push_back(point.p_first.z());
  const double unit = 1 / Median(std::move(depths));  // the scene's median depth becomes one map unit
  MapKeyframe& first = map_->AddKeyframe(start.first, T_world_first);
  const SE3<Camera, Camera> T_first_second(start.T_first_second.rotation(), unit * start.T_first_second.translation());
  MapKeyframe& second = map_->AddKeyframe(start.second, T_world_first * T_first_second);
  second.parent = first.id;
  for (const InitialViews::Point& point : start.points) {
    PointTrack& track = map_->AddPoint(T_world_first * Eigen::Vector3d(unit * point.p_first));
    map_->AddObservation(track, first, point.first_feature);
    map_->AddObservation(track, second, point.second_feature);
    map_->Refresh(track);
  }
  MapProblem problem = GlobalProblem(*map_, config_, /*find_lens=*/false);
  const BundleSummary summary = AdjustBundle(problem.bundle, {.max_iterations = 20, .dense = true});
  if (!summary.usable || summary.final_rms_px > kMaxRms_px) return false;
  ApplyGlobal(problem, *map_);
  latest_ = second.id;
  return map_->points().size() >= kMinPoints;
}

// ------------------------------------------------------------------------------------------------ keyframes

MapKeyframe& SparseMapper::InsertKeyframe(const TrackedImage& image) {
  std::shared_ptr<const FrameFeatures> features = image.features;
  const Frame& frame = *image.tracked.frame;
  if (!image.pose_given) {
    // Objects are small: their corners are worth a second look.
    const std::vector<Feature> more = extractor_.ExtractObjects(frame, UncorrectedFeatures(*features));
    if (!more.empty()) {
      std::vector<Feature> all = UncorrectedFeatures(*features);
      all.insert(all.end(), more.begin(), more.end());
      features = MakeFrameFeatures(frame, std::move(all));
    }
  }
  TrackedFrame tracked = image.tracked;
  Place(tracked);
  MapKeyframe& keyframe = map_->AddKeyframe(std::move(features), tracked.T_world_camera);
  keyframe.scene_features = image.features->size();
  keyframe.pose_given = image.pose_given;
  if (!image.pose_given && frame.T_world_camera && world_is_given_) {
    keyframe.prior = PosePrior{.T_world_camera = *frame.T_world_camera,
                               .rotation_sigma_rad = config_.prior_sigma_rad,
                               .translation_sigma_mu = config_.prior_sigma_mu};
  }
  for (size_t i = 0; i < image.points.size(); ++i) {
    if (!image.points[i]) continue;
    if (PointTrack* track = map_->FindPoint(image.points[i]))
      map_->AddObservation(*track, keyframe, static_cast<int>(i));
  }
  return keyframe;
}

KeyframeView SparseMapper::AddKeyframe(const TrackedImage& image) {
  if (map_->keyframes().empty()) {
    ++generation_;
    // Poses that are given or believed make the world theirs.
    world_is_given_ = true;
  }
  MapKeyframe& keyframe = InsertKeyframe(image);
  if (keyframe.pose_given) {
    std::vector<MapPointId> all;
    for (const auto& [id, track] : map_->points()) all.push_back(id);
    maker_->FindKnownPoints(keyframe, all);
  } else {
    maker_->FindKnownPoints(keyframe, PointsOf(Neighborhood(keyframe, 20, 5)));
  }
  const auto neighbors = map_->Covisible(keyframe, 1);
  keyframe.parent = neighbors.empty() ? latest_ : neighbors.front().first;
  latest_ = keyframe.id;
  const auto known =
      std::count_if(keyframe.points.begin(), keyframe.points.end(), [](MapPointId id) { return bool(id); });
  const bool is_scarce = !keyframe.pose_given && known < kScarcePoints;
  PointMaker finder(is_scarce ? PointMaker::Generous(config_) : config_, map_.get());
  finder.MakePointsByParallax(keyframe, finder.KeyframesToMatch(keyframe));
  maker_->MakePointsByDepth(keyframe);
  if (!keyframe.pose_given) {
    std::vector<MapKeyframe*> around;
    for (const KeyframeId id : Neighborhood(keyframe, 8, 0)) around.push_back(map_->FindKeyframe(id));
    maker_->FuseDuplicates(keyframe, around);
  }
  for (const MapPointId id : keyframe.points) {
    if (id) map_->Refresh(*map_->FindPoint(id));
  }
  CullPoints(config_, *map_);
  if (!keyframe.pose_given) {
    AdjustWindow(keyframe);
    for (const KeyframeId gone : CullKeyframes(config_, keyframe, *map_)) places_->Remove(gone);
  }
  places_->Add(keyframe);
  if (!keyframe.pose_given) CloseLoops(keyframe);
  TurnUp();
  PublishLocalMap(keyframe.id);
  KeyframeView view = MakeView(image.tracked, keyframe);
  return view;
}

void SparseMapper::AdjustWindow(const MapKeyframe& keyframe) {
  const auto begin = std::chrono::steady_clock::now();
  MapProblem problem = WindowProblem(*map_, keyframe, config_);
  // Every second adjustment at least is carried through.
  const std::atomic<bool>* abort = window_was_cut_short_ ? nullptr : &early_stop_requested_;
  const BundleSummary summary =
      AdjustBundle(problem.bundle, {.max_iterations = kMaxWindowIterations, .dense = true, .abort = abort});
  window_was_cut_short_ = summary.aborted;
  if (summary.usable) ApplyWindow(problem, *map_);
  figures_.window_s.push_back(Seconds(std::chrono::steady_clock::now() - begin));
}

void SparseMapper::CloseLoops(const MapKeyframe& keyframe) {
  std::optional<LoopMatch> loop;
  if (config_.close_loops) loop = places_->FindLoop(keyframe, metric_ || world_is_given_);
  if (!loop) {
    if (map_->keyframe_count() < next_whole_) return;
    // Priors tell of the whole map's scale, which windows alone learn too late.
    next_whole_ += world_is_given_ ? kWholePeriodWithPriors_keyframes : next_whole_;
    if (!whole_) StartGlobalAdjustment();
    return;
  }
  DropGlobalAdjustment();  // it knows nothing of the loop
  if (CloseLoop(*loop, metric_ || world_is_given_, config_, *map_)) {
    ++figures_.loops;
    StartGlobalAdjustment();
  } else {
    ++figures_.sewn;
  }
}

std::vector<KeyframeId> SparseMapper::Neighborhood(const MapKeyframe& keyframe, size_t first, size_t second) const {
  std::vector<KeyframeId> ids;
  std::set<KeyframeId> known = {keyframe.id};
  auto around = map_->Covisible(keyframe, kMinSharedPoints);
  if (around.empty() && keyframe.parent) around.emplace_back(keyframe.parent, 0);
  if (around.size() > first) around.resize(first);
  for (const auto& [id, shared] : around) {
    if (known.insert(id).second) ids.push_back(id);
  }
  if (second == 0) return ids;
  for (const auto& [id, shared] : around) {
    size_t taken = 0;
    for (const auto& [next, count] : map_->Covisible(*map_->FindKeyframe(id), kMinSharedPoints)) {
      if (taken++ == second) break;
      if (known.insert(next).second) ids.push_back(next);
    }
  }
  return ids;
}

std::vector<MapPointId> SparseMapper::PointsOf(const std::vector<KeyframeId>& keyframes) const {
  std::set<MapPointId> points;
  for (const KeyframeId id : keyframes) {
    for (const MapPointId point : map_->FindKeyframe(id)->points) {
      if (point) points.insert(point);
    }
    if (points.size() > kMaxLocalPoints) break;
  }
  return {points.begin(), points.end()};
}

KeyframeView SparseMapper::MakeView(const TrackedFrame& tracked, const MapKeyframe& keyframe) {
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
    view.points.push_back(map_->FindPoint(keyframe.points[i])->point);
  }
  view.removed_points = map_->TakeRemovedPoints();
  return view;
}

// ------------------------------------------------------------------------------------------------ the whole map

void SparseMapper::StartGlobalAdjustment() {
  DropGlobalAdjustment();
  whole_ = std::make_unique<GlobalAdjustment>();
  whole_->problem = GlobalProblem(*map_, config_, MayFindLens());
  const auto solve = [whole = whole_.get()] {
    whole->summary =
        AdjustBundle(whole->problem.bundle, {.max_iterations = 20, .function_tolerance = 1e-6, .abort = &whole->abort});
    whole->done = true;
  };
  if (inline_adjustment_) return solve();
  whole_->thread = std::thread([solve] {
    LowerThreadPriority();
    solve();
  });
}

// A few views of little do not tell a lens from a bent scene, and poses that are given or believed were made with the
// client's idea of the lens.
bool SparseMapper::MayFindLens() const {
  return config_.refine_lens && !world_is_given_ && map_->keyframes().size() >= kKeyframesToFindLens;
}

bool SparseMapper::TakeGlobalAdjustment(bool wait) {
  if (!whole_ || (!wait && !whole_->done)) return false;
  if (whole_->thread.joinable()) whole_->thread.join();
  const BundleSummary& summary = whole_->summary;
  spdlog::debug("slam: whole bundle of {} keyframes and {} points: {:.2f} -> {:.2f} px",
                whole_->problem.keyframes.size(), whole_->problem.points.size(), summary.initial_rms_px,
                summary.final_rms_px);
  if (whole_->problem.bundle.lens) spdlog::debug("slam: lens k1 {:.4f}", whole_->problem.bundle.lens->correction.k1);
  const bool usable = summary.usable;
  if (usable) {
    ApplyGlobal(whole_->problem, *map_);
    up_.LookAgain();
  }
  whole_ = nullptr;
  if (usable && latest_) PublishLocalMap(latest_);
  return usable;
}

void SparseMapper::DropGlobalAdjustment() {
  if (!whole_) return;
  whole_->abort = true;
  if (whole_->thread.joinable()) whole_->thread.join();
  whole_ = nullptr;
}

bool SparseMapper::TurnUp(bool is_last) {
  if (world_is_given_) return false;
  const std::optional<Eigen::Quaterniond> R_new_old = up_.Correct(*map_, is_last);
  figures_.up_confidence = up_.confidence();
  if (!R_new_old) return false;
  const bool was_adjusting = whole_ != nullptr;
  DropGlobalAdjustment();
  map_->Transform({1.0, *R_new_old, Eigen::Vector3d::Zero()});
  up_.Turned(*R_new_old);
  if (was_adjusting) StartGlobalAdjustment();
  return true;
}

// ------------------------------------------------------------------------------------------------ for tracking

void SparseMapper::FindLostCamera(const TrackedImage& image) {
  if (map_->keyframes().empty()) return;
  const auto found = places_->FindCamera(*image.features);
  if (!found) return;
  ++figures_.relocalizations;
  PublishLocalMap(found->place, LocalMap::Relocalization{.frame_id = image.features->frame_id,

                                                         .T_world_camera = found->T_world_camera});
}

void SparseMapper::PublishLocalMap(KeyframeId around, std::optional<LocalMap::Relocalization> relocalized) {
  auto local = std::make_shared<LocalMap>();
  local->keyframes_done = map_->keyframe_count();
  local->generation = generation_;
  local->lens = map_->lens();
  local->reference = around;
  local->relocalized = relocalized;
  const MapKeyframe* center = map_->FindKeyframe(around);
  if (center != nullptr) {
    std::vector<KeyframeId> keyframes = Neighborhood(*center, 20, 5);
    keyframes.insert(keyframes.begin(), around);
    for (const MapPointId id : PointsOf(keyframes)) {
      const PointTrack& track = *map_->FindPoint(id);
      local->index[id] = static_cast<int>(local->points.size());
      local->points.push_back(MakeLocalPoint(track));
    }
    const int well_placed = std::min(kMinObservationsWellPlaced, static_cast<int>(map_->keyframes().size()));
    for (size_t i = 0; i < center->scene_features; ++i) {
      const MapPointId id = center->points[i];
      local->reference_points += id && map_->FindPoint(id)->point.observations >= well_placed ? 1 : 0;
    }
    const uint64_t newest = map_->keyframe_count();
    for (uint64_t id = newest > kPlacesTold ? newest - kPlacesTold : 1; id <= newest; ++id) {
      keyframes.push_back(KeyframeId{id});
    }
    for (const KeyframeId id : keyframes) {
      if (const auto pose = map_->KeyframePose(id)) local->keyframes[id] = *pose;
    }
  }
  slot_->Put(std::move(local));
}

}  // namespace romap::slam
