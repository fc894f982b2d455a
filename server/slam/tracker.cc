#include "server/slam/tracker.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "common/statistics.h"

namespace romap::slam {
namespace {

constexpr int kMinFeatures = 50;
constexpr int kMinInliers = 25;
constexpr int kMinInliersBeforePatches = 10;
constexpr int kInliersWithoutPatches = 150;
constexpr size_t kFewLastPoints = 150;
constexpr size_t kEnoughLastPoints = 100;
constexpr int kMinInliersToConfirm = 40;  // see TrackingStatus::NeedsConfirmation
constexpr double kFollowRadius_px = 12;
constexpr double kReferenceRadius_px = 36;
constexpr double kMaxStepShare = 0.5;  // of the scene's depth: no camera moves farther between two frames
constexpr int kMinDepthsToInitialize = 150;
constexpr int kFewInliers = 100;  // with fewer, a pose may be wrong, and the depth image would add many points
constexpr double kNewMapAfterLost_s = 0.7;  // a camera that is lost for longer is probably in new territory
// A map that is initialized with priors inherits their errors. Priors are used as poses until the map has enough points
// and keyframes for these errors to average out.
constexpr int kMapPointsToLeavePriors = 150;
constexpr uint64_t kKeyframesToLeavePriors = 12;
// The errors of the points are about as large as those of the features: they double the variance.
constexpr double kPointErrorFactor = 1.4;
// Standard deviation of the angle by which points are wrong that were made beyond the reference keyframe, at a distance
// of the scene's depth from it. From live runs, in which it is 0.05 to 0.3, depending on how late mapping is.
constexpr double kNewPointsError = 0.15;

// Median depth of the points in front of a camera; 0 if there are none.
double MedianDepth_mu(const LocalMap& map, const SE3<World, Camera>& T_world_camera) {
  const SE3<Camera, World> T_camera_world = T_world_camera.Inverse();
  std::vector<double> depths_mu;
  for (const LocalPoint& point : map.points) {
    const double depth_mu = (T_camera_world * point.position_world).z();
    if (depth_mu > 0) depths_mu.push_back(depth_mu);
  }
  return depths_mu.empty() ? 0 : Median(std::move(depths_mu));
}

}  // namespace

Tracker::Tracker(const SlamConfig& config, PoseUse pose_use, const LocalMapSlot* local_map)
    : config_(config),
      pose_use_(pose_use),
      slot_(local_map),
      extractor_(config),
      given_(config),
      monocular_initializer_(config),
      selector_(config),
      tentative_points_(config),
      rotation_(config),
      given_checks_(config) {}

TrackedImage Tracker::Track(std::shared_ptr<const Frame> frame) {
  TakeNewestMap();
  const cv::Mat depth_mu = frame->depth_mu;
  if (given_checks_.IsDepthContradicted() && !depth_mu.empty()) frame = WithoutDepth(*frame);
  if (ShouldUseGivenPose(*frame)) return UseGivenPose(std::move(frame), depth_mu);
  auto features = MakeFrameFeatures(*frame, RemoveFixed(*frame, extractor_.ExtractScene(*frame)),
                                    map_ ? map_->lens : RadialCorrection{});
  const bool has_map = HasMap() && !pending_map_;
  const bool has_pose = frame->T_world_camera.has_value();
  TrackedImage image =
      has_map ? TrackByImage(std::move(frame), std::move(features)) : Initialize(std::move(frame), std::move(features));
  image.fixed_px = fixed_px_;
  image.diagnostics = Diagnostics(*image.tracked.frame);
  image.pose_ignored = has_pose && pose_use_ != PoseUse::kIgnore && has_map && !world_is_given_;
  return image;
}

std::vector<Feature> Tracker::RemoveFixed(const Frame& frame, std::vector<Feature> features) {
  const std::vector<uint8_t> is_fixed = fixed_features_.Find(frame.camera, features);
  fixed_px_.clear();
  std::vector<Feature> moving;
  moving.reserve(features.size());
  for (size_t i = 0; i < features.size(); ++i) {
    if (is_fixed[i] != 0) {
      fixed_px_.push_back(features[i].pixel_px);
    } else {
      moving.push_back(features[i]);
    }
  }
  return moving;
}

// ------------------------------------------------------------------------------------------------ the local map

void Tracker::TakeNewestMap() {
  const std::shared_ptr<const LocalMap> newest = slot_->Get();
  if (!newest || newest == map_) return;
  if (!map_ || newest->generation != map_->generation) {
    tentative_points_.Reset();
    AdoptNewMap(*newest);
  } else if (!world_is_given_) {
    // The camera moves with the keyframe it was tracked against.
    const auto before = map_->keyframes.find(map_->reference);
    const auto after = newest->keyframes.find(map_->reference);
    if (before != map_->keyframes.end() && after != newest->keyframes.end()) {
      motion_.Correct(before->second, after->second);
      tentative_points_.Correct(before->second, after->second);
    }
  }
  map_ = newest;
}

void Tracker::AdoptNewMap(const LocalMap& newest) {
  const bool is_answer = pending_map_ && newest.generation > pending_map_->generation;
  const auto pending = is_answer ? std::exchange(pending_map_, std::nullopt) : std::nullopt;
  const bool is_known = !newest.points.empty() && newest.map <= newest_map_;
  if (!newest.points.empty()) newest_map_ = std::max(newest_map_, newest.map);
  if (is_known) return AdoptKnownMap(newest);
  if (pending && !newest.points.empty()) {
    motion_.Reset();
    rotation_.Reset();  // its world was provisional
    StartMotion(newest, *pending);
    selector_.ForgetLastKeyframe();
    status_.OnMapInitialized();
  } else if (pending) {
    motion_.ResetMotion();
    status_.OnMapReset();
  } else if (newest.points.empty() && !world_is_given_) {
    motion_.Reset();
    status_.OnMapReset();
    monocular_initializer_.Reset();
  }
  keyframes_sent_ = std::max(keyframes_sent_, newest.keyframes_done);
}

// The camera was found in a map that it was in before, or no new map was initialized from the initial views. It stays
// lost until a frame is tracked there.
void Tracker::AdoptKnownMap(const LocalMap& newest) {
  keyframes_sent_ = newest.keyframes_done;
  if (newest.map == map_->map) return;
  motion_.Reset();
  rotation_.Reset();
  last_points_.clear();
  selector_.ForgetLastKeyframe();
}

// The initial views are the last known poses of the camera. A fast camera has moved on while the map was initialized,
// so its motion is needed to predict the next pose.
void Tracker::StartMotion(const LocalMap& initial, const PendingMap& pending) {
  const auto reference = initial.keyframes.find(initial.reference);
  if (reference != initial.keyframes.begin() && pending.newest_timestamp_ns > pending.first_timestamp_ns) {
    motion_.Update(std::prev(reference)->second.T_world_camera, {}, pending.first_timestamp_ns, false);
    motion_.Update(reference->second.T_world_camera, {}, pending.newest_timestamp_ns, true);
  } else {
    motion_.Update(reference->second.T_world_camera, {}, pending.newest_timestamp_ns, false);
  }
  last_points_.clear();
}

// ------------------------------------------------------------------------------------------------ given poses

bool Tracker::ShouldUseGivenPose(const Frame& frame) const {
  if (!frame.T_world_camera || pose_use_ == PoseUse::kIgnore || pending_map_) return false;
  // A map that was initialized from images has a different world frame than the client.
  if (HasMap() && !world_is_given_) return false;
  const bool map_suffices = pose_use_ == PoseUse::kPrior && HasMap() &&
                            map_->keyframes_done >= kKeyframesToLeavePriors &&
                            map_->points.size() >= static_cast<size_t>(kMapPointsToLeavePriors);
  return !map_suffices;
}

// `depth_mu`: of the frame, even if it is not used.
TrackedImage Tracker::UseGivenPose(std::shared_ptr<const Frame> frame, const cv::Mat& depth_mu) {
  TrackedImage image;
  const SE3<World, Camera>& pose = *frame->T_world_camera;
  const auto readout = motion_.ReadoutTo(pose, frame->camera.readout_s, frame->timestamp_ns);
  const auto shutter = ShutterOf(*frame, readout, HasMap() ? MedianDepth_mu(*map_, pose) : 0);
  image.tracked = given_.Track(frame);
  image.tracked.map = map_ ? map_->map : SparseMapId{1};
  image.pose_given = pose_use_ == PoseUse::kGiven;
  image.generation = map_ ? map_->generation : 0;
  world_is_given_ = true;
  rotation_.Reset();
  status_.OnGivenPose();
  motion_.Update(pose, pose, frame->timestamp_ns, /*is_continuous=*/true);
  last_points_.clear();
  if (shutter) converter_.Convert(*shutter, image.tracked);
  if (!image.pose_given) AnchorToReference(image.tracked);
  if (image.tracked.is_keyframe) {
    const Frame& converted = *image.tracked.frame;
    image.features = MakeFrameFeatures(converted, RemoveFixed(converted, extractor_.Extract(converted)),
                                       RadialCorrection{}, shutter);
    const bool depth_was_wrong = given_checks_.IsDepthContradicted();
    given_checks_.AddFrame(*frame, image.features, pose, depth_mu);
    if (given_checks_.IsDepthContradicted() && !depth_was_wrong) RefuseDepth(image);
  }
  image.diagnostics = Diagnostics(*frame);
  if (const auto contradiction = given_checks_.PosesOrCamera()) {
    RefuseGivenPose(image, contradiction->reason, contradiction->since_frame);
  } else if (image.tracked.is_keyframe) {
    image.points.resize(image.features->size());
    ++keyframes_sent_;
  }
  return image;
}

void Tracker::RefuseGivenPose(TrackedImage& image, const char* reason, uint64_t since_frame) {
  TrackedFrame& tracked = image.tracked;
  status_.OnLost(tracked.frame->frame_id, tracked.frame->timestamp_ns);
  tracked.state = TrackingState::kLost;
  tracked.is_keyframe = false;
  tracked.reason = reason;
  tracked.contradicted_since_frame = since_frame;
  image.features = nullptr;
}

// This frame is the first one whose depth is not used.
void Tracker::RefuseDepth(TrackedImage& image) {
  image.tracked.frame = WithoutDepth(*image.tracked.frame);
  image.tracked.is_keyframe = false;
  image.tracked.contradicted_since_frame = given_checks_.depth_contradicted_since_frame();
  image.features = nullptr;
  image.discard_points = true;
}

std::vector<Diagnostic> Tracker::Diagnostics(const Frame& frame) const {
  std::vector<Diagnostic> diagnostics = given_checks_.Diagnostics();
  if (const auto readout = readout_check_.Check(frame.camera.readout_s)) diagnostics.push_back(*readout);
  return diagnostics;
}

// ------------------------------------------------------------------------------------------------ initialization

TrackedImage Tracker::Initialize(std::shared_ptr<const Frame> frame, std::shared_ptr<const FrameFeatures> features) {
  TrackedImage image;
  image.generation = map_ ? map_->generation : 0;
  image.tracked.frame = frame;
  image.tracked.state = TrackingState::kInitializing;
  image.features = features;
  TrackRotation(image);
  if (pending_map_) {
    if (status_.IsLost()) image.tracked.state = TrackingState::kLost;
    image.tracked.reason = "map initialization in progress";
    return image;
  }
  FindInitialViews(image, &image.tracked.reason);
  if (!image.initial_views) return image;
  world_is_given_ = false;
  motion_.Reset();
  return image;
}

void Tracker::TrackRotation(TrackedImage& image) {
  image.tracked.R_world_camera = rotation_.Track(image.features);
  if (rotation_.HasStarted() || status_.IsLost()) return;
  const Eigen::Vector3d down = image.tracked.frame->gravity_camera.value_or(Eigen::Vector3d::UnitY());
  image.tracked.R_world_camera = RotationFromZTo(-down).conjugate();
  rotation_.Start(image.features, *image.tracked.R_world_camera);
}

void Tracker::FindInitialViews(TrackedImage& image, std::string* reason) {
  const FrameFeatures& features = *image.features;
  const auto with_depth =
      std::count_if(features.ranges_mu.begin(), features.ranges_mu.end(), [](double r) { return r > 0; });
  if (with_depth >= kMinDepthsToInitialize) {
    image.initial_views = InitialViews{.first = image.features};
    *reason = "view with depth found; initializing the map";
    monocular_initializer_.Reset();
  } else {
    image.initial_views = monocular_initializer_.AddFrame(image.features, reason);
  }
  if (!image.initial_views) return;
  const FrameFeatures& newest = image.initial_views->second ? *image.initial_views->second : features;
  pending_map_ = PendingMap{.generation = image.generation,
                            .first_timestamp_ns = image.initial_views->first->timestamp_ns,
                            .newest_timestamp_ns = newest.timestamp_ns};
  keyframes_sent_ += image.initial_views->second ? 2 : 1;
}

// ------------------------------------------------------------------------------------------------ tracking

TrackedImage Tracker::TrackByImage(std::shared_ptr<const Frame> frame, std::shared_ptr<const FrameFeatures> features) {
  TrackedImage image;
  image.tracked.frame = frame;
  image.tracked.up_world = map_->up_world;
  image.tracked.map = map_->map;
  image.features = features;
  image.generation = map_->generation;
  if (features->size() < static_cast<size_t>(kMinFeatures)) {
    MarkLost(fmt::format("too little texture: {} features, {} needed", features->size(), kMinFeatures), image);
    return image;
  }
  const std::shared_ptr<const LocalMap> local_map = MapForNextFrame();
  const auto predicted = motion_.PredictReadout(frame->camera.readout_s, frame->timestamp_ns);
  const auto expected = ShutterOf(*frame, predicted, scene_depth_mu_);
  if (expected) image.features = WithShutter(*features, expected);
  const LocalMapTracking tracking(*local_map, *image.features, config_);
  const std::optional<PoseFromPoints> pose = FindPose(*frame, tracking);
  if (!pose) {
    MarkLost("too few map points matched", image);
    return image;
  }
  const auto readout = motion_.ReadoutTo(pose->T_world_camera, frame->camera.readout_s, frame->timestamp_ns);
  const auto shutter = status_.IsLost() ? nullptr : ShutterOf(*frame, readout, tracking.MedianDepth_mu(*pose));
  if (shutter) {
    AcceptConverted(shutter, *features, *pose, *local_map, tracking, image);
  } else {
    CheckReadout(*features, *pose, tracking, image);
    Accept(*pose, *local_map, tracking, image);
  }
  return image;
}

// The pose determines the motion that led to it, which is more accurate than the predicted one.
void Tracker::AcceptConverted(const std::shared_ptr<const RollingShutter>& shutter, const FrameFeatures& rolling,
                              const PoseFromPoints& pose, const LocalMap& local_map, const LocalMapTracking& tracking,
                              TrackedImage& image) {
  const auto converted = WithShutter(rolling, shutter, tracking.DepthsOfFeatures(pose));
  const LocalMapTracking again(local_map, *converted, config_);
  if (const auto refined = again.RefineMatches(pose, image.tracked.frame->image_bgr)) {
    image.features = converted;
    CheckReadout(rolling, *refined, again, image);
    Accept(*refined, local_map, again, image);
  } else {
    Accept(pose, local_map, tracking, image);
  }
  converter_.Convert(*shutter, image.tracked);
}

void Tracker::CheckReadout(const FrameFeatures& rolling, const PoseFromPoints& pose, const LocalMapTracking& tracking,
                           const TrackedImage& image) {
  if (status_.IsLost()) return;
  const Frame& frame = *image.tracked.frame;
  const auto per_second = motion_.ReadoutTo(pose.T_world_camera, 1, frame.timestamp_ns);
  if (per_second) readout_check_.AddFrame(frame, rolling, pose, tracking, *per_second);
}

// The newest local map, with tentative points while keyframes wait to be mapped, and afterward until enough map points
// are matched again. Without need they do harm: they make the scale of a weak map drift.
std::shared_ptr<const LocalMap> Tracker::MapForNextFrame() {
  const bool keyframes_wait = keyframes_sent_ > map_->keyframes_done;
  needs_tentative_points_ = keyframes_wait || (needs_tentative_points_ && last_points_.size() < kEnoughLastPoints);
  if (!needs_tentative_points_) return map_;
  const std::vector<LocalPoint> tentative = tentative_points_.Make();
  if (tentative.empty()) return map_;
  auto extended = std::make_shared<LocalMap>(*map_);
  extended->points.insert(extended->points.end(), tentative.begin(), tentative.end());
  return extended;
}

std::optional<PoseFromPoints> Tracker::FindPose(const Frame& frame, const LocalMapTracking& tracking) const {
  if (const auto first = FindFirstPose(frame, tracking)) {
    if (auto confirmed = ConfirmByAllPoints(frame, *first, tracking)) return confirmed;
  }
  // A frame that was relocalized before the current loss would be misleading.
  const auto& relocalized = map_->relocalized;
  if (!status_.IsLost() || !relocalized || relocalized->frame_id < status_.lost_since_frame()) return std::nullopt;
  const auto first = tracking.TrackNear(relocalized->T_world_camera);
  return first ? ConfirmByAllPoints(frame, *first, tracking) : std::nullopt;
}

std::optional<PoseFromPoints> Tracker::FindFirstPose(const Frame& frame, const LocalMapTracking& tracking) const {
  if (!motion_.last_pose()) return std::nullopt;
  const bool is_lost = status_.IsLost();
  const SE3<World, Camera> start =
      is_lost ? *motion_.last_pose() : motion_.Predict(frame, /*use_prior=*/pose_use_ == PoseUse::kPrior);
  std::optional<PoseFromPoints> first;
  if (!is_lost) first = tracking.TrackByProjection(last_points_, start, kFollowRadius_px);
  if (!first) first = tracking.TrackByProjection(last_points_, start, kReferenceRadius_px);
  if (!first && !is_lost) first = tracking.TrackLoosely(start, kFollowRadius_px);
  if (!first && !is_lost) first = tracking.TrackLoosely(start, kReferenceRadius_px);
  const bool has_few = is_lost || last_points_.size() < kFewLastPoints;
  if (!first) first = tracking.TrackByDescriptors(has_few ? std::vector<MapPointId>() : last_points_);
  return first;
}

std::optional<PoseFromPoints> Tracker::ConfirmByAllPoints(const Frame& frame, const PoseFromPoints& first,
                                                          const LocalMapTracking& tracking) const {
  auto pose = tracking.TrackAllPoints(first, kMinInliersBeforePatches);
  if (!pose) return std::nullopt;
  // Detector and descriptors are less repeatable than the image itself.
  if (config_.refine_observations && pose->inliers < kInliersWithoutPatches) {
    pose = tracking.AddPatches(*pose, HalvedImages(frame.image_bgr));
  }
  if (!pose || pose->inliers < (status_.NeedsConfirmation() ? kMinInliersToConfirm : kMinInliers)) return std::nullopt;
  if (motion_.last_pose() && status_.IsTracking()) {
    const double depth_mu = tracking.MedianDepth_mu(*pose);
    const double step_mu = (pose->T_world_camera.translation() - motion_.last_pose()->translation()).norm();
    if (step_mu > kMaxStepShare * depth_mu) return std::nullopt;
    // Few points may agree on a wrong pose, but not on one that continues the motion.
    const SE3<World, Camera> predicted = motion_.Predict(frame, /*use_prior=*/pose_use_ == PoseUse::kPrior);
    const bool is_doubtful = pose->inliers < kFewInliers && motion_.HasMotion();
    if (is_doubtful && !IsPlausible(predicted, pose->T_world_camera, depth_mu)) return std::nullopt;
  }
  return pose;
}

void Tracker::Accept(const PoseFromPoints& pose, const LocalMap& local_map, const LocalMapTracking& tracking,
                     TrackedImage& image) {
  const bool was_lost = status_.IsLost();
  const Frame& frame = *image.tracked.frame;
  image.tracked.state = status_.OnTracked();
  image.tracked.T_world_camera = pose.T_world_camera;
  AnchorToReference(image.tracked);
  StateUncertainty(pose, tracking.MedianDepth_mu(pose), image.tracked);
  motion_.Update(pose.T_world_camera, frame.T_world_camera, frame.timestamp_ns, /*is_continuous=*/!was_lost);
  last_points_.clear();
  image.points.assign(image.features->size(), {});
  for (size_t i = 0; i < image.points.size(); ++i) {
    const int point = pose.point_of_feature[i];
    if (point < 0) continue;
    image.points[i] = local_map.points[static_cast<size_t>(point)].id;
    if (image.points[i]) last_points_.push_back(image.points[i]);
  }
  const auto points_by_feature = static_cast<int>(last_points_.size());
  for (const int point : pose.points_by_patch) {
    last_points_.push_back(local_map.points[static_cast<size_t>(point)].id);
  }
  rotation_.Start(image.features, pose.T_world_camera.rotation());
  const double depth_mu = tracking.MedianDepth_mu(pose);
  scene_depth_mu_ = depth_mu;
  tentative_points_.Record(image.features, pose.T_world_camera, image.points, depth_mu);
  image.tracked.is_keyframe = DecideKeyframe(image, depth_mu, points_by_feature);
  if (image.tracked.is_keyframe) ++keyframes_sent_;
}

void Tracker::MarkLost(const std::string& why, TrackedImage& image) {
  const int64_t timestamp_ns = image.tracked.frame->timestamp_ns;
  if (!status_.IsLost()) monocular_initializer_.Reset();
  status_.OnLost(image.tracked.frame->frame_id, timestamp_ns);
  image.tracked.state = TrackingState::kLost;
  image.tracked.reason = why;
  image.tracked.R_world_camera = rotation_.Track(image.features);
  motion_.ResetMotion();
  tentative_points_.Reset();
  const double lost_s = 1e-9 * static_cast<double>(timestamp_ns - status_.lost_since_ns());
  if (world_is_given_ || lost_s < kNewMapAfterLost_s) return;
  std::string no_views;
  FindInitialViews(image, &no_views);
  image.tracked.reason += "; new map: " + no_views;
}

bool Tracker::DecideKeyframe(const TrackedImage& image, double depth_mu, int points_by_feature) {
  // The pose of a camera that was just relocalized may be wrong: do not extend the map with it yet.
  if (status_.frames_since_recovery() < 2 && map_->keyframes_done > 4) return false;
  const uint64_t waiting = keyframes_sent_ - std::min(keyframes_sent_, map_->keyframes_done);
  TrackingQuality quality;
  quality.scene_depth_mu = depth_mu;
  quality.tracked_share = points_by_feature / std::max(1.0, static_cast<double>(map_->reference_points));
  quality.keyframes_waiting = static_cast<int>(waiting);
  quality.has_new_depth = image.features->HasDepth() && last_points_.size() < kFewInliers;
  return selector_.IsKeyframe(*image.tracked.frame, image.tracked.T_world_camera, quality);
}

void Tracker::AnchorToReference(TrackedFrame& tracked) const {
  if (!map_) return;
  const auto reference = map_->keyframes.find(map_->reference);
  if (reference == map_->keyframes.end()) return;
  tracked.reference = map_->reference;
  tracked.T_reference_camera = reference->second.Relative(tracked.T_world_camera);
}

// The uncertainty of the reference keyframe includes the errors that all points around it have in common. What is added
// to it: errors of features and points that differ from point to point, and the errors of the points that the reference
// observes badly. The latter's share grows with the distance from the reference, and so does the effect of their depths
// on the pose. It dominates while mapping is late.
void Tracker::StateUncertainty(const PoseFromPoints& pose, double depth_mu, TrackedFrame& tracked) const {
  const auto reference = map_->keyframes.find(map_->reference);
  const bool is_known = pose.uncertainty.position_sigma_mu > 0 && pose.uncertainty.rotation_sigma_rad > 0;
  if (reference == map_->keyframes.end() || !is_known || !(depth_mu > 0)) return;
  const ScaledPose& from = reference->second;
  const double distance = (pose.T_world_camera.translation() - from.T_world_camera.translation()).norm() / depth_mu;
  const double new_points_rad = kNewPointsError * distance * distance;
  PoseUncertainty& relative = tracked.reference_uncertainty;
  relative = Combine(
      {kPointErrorFactor * pose.uncertainty.position_sigma_mu, kPointErrorFactor * pose.uncertainty.rotation_sigma_rad},
      {new_points_rad * depth_mu, new_points_rad});
  tracked.uncertainty = Combine(map_->reference_uncertainty, relative);
  relative.position_sigma_mu /= from.scale;
}

}  // namespace romap::slam
