#include "server/slam/tracker.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/statistics.h"
#include "server/slam/geometry/pnp.h"
#include "server/slam/projection_search.h"

namespace romap::slam {
namespace {

constexpr int kMinFeatures = 50;
constexpr int kMinFirstInliers = 20;      // among the last frame's points
constexpr int kMinInliers = 25;           // among all points
constexpr int kMinInliersAfterLoss = 40;  // stricter as long as the pose has not proven itself
constexpr int kProvenAfter_frames = 15;
constexpr double kMinInlierShare = 0.35;  // of the matches
constexpr double kFollowRadius_px = 12;
constexpr double kWideRadius_px = 36;
constexpr double kLocalRadius_px = 3.5;
constexpr int kMaxDistance = 70;       // Hamming, bits, where a projection narrows the search
constexpr int kMaxLooksDistance = 60;  // where nothing does
constexpr double kLooksRatio = 0.8;
constexpr double kLongestPrediction_s = 0.25;
constexpr double kLongestDepartureShare = 0.5;  // of the scene's depth: no camera jumps so far between two frames
constexpr int kStartDepthPoints = 150;
// Where priors begin a map their errors become the map's until there are enough of them to average out.
constexpr int kMapPointsToLeavePriors = 150;
constexpr uint64_t kKeyframesToLeavePriors = 12;

double DepthOf(const SE3<Camera, World>& T_camera_world, const LocalPoint& point) {
  return (T_camera_world * point.position_world).z();
}

double MedianDepth_mu(const LocalMap& map, const SE3<World, Camera>& T_world_camera,
                      const std::vector<int>& point_of_feature) {
  const SE3<Camera, World> T_camera_world = T_world_camera.Inverse();
  std::vector<double> depths_mu;
  for (const int point : point_of_feature) {
    if (point >= 0) depths_mu.push_back(DepthOf(T_camera_world, map.points[static_cast<size_t>(point)]));
  }
  if (depths_mu.empty()) return 0;
  return Median(std::move(depths_mu));
}

}  // namespace

Tracker::Tracker(const SlamConfig& config, PoseUse pose_use, const LocalMapSlot* local_map)
    : config_(config),
      pose_use_(pose_use),
      slot_(local_map),
      extractor_(config),
      given_(config),
      monocular_initializer_(config),
      selector_(config) {}

TrackedImage Tracker::Track(std::shared_ptr<const Frame> frame) {
  TakeNewestMap();
  const bool has_map = map_ && !map_->points.empty();
  const bool has_pose = frame->T_world_camera && pose_use_ != PoseUse::kIgnore;
  const bool is_clients_world = world_is_given_ || !has_map;
  if (has_pose && is_clients_world && !waiting_for_map_) {
    const bool map_suffices = pose_use_ == PoseUse::kPrior && has_map &&
                              map_->keyframes_done >= kKeyframesToLeavePriors &&
                              map_->points.size() >= static_cast<size_t>(kMapPointsToLeavePriors);
    if (!map_suffices) return TakeGivenPose(std::move(frame));
  }
  auto features = MakeFrameFeatures(*frame, extractor_.ExtractScene(*frame), map_ ? map_->lens : RadialCorrection{});
  if (!has_map || waiting_for_map_) return Initialize(std::move(frame), std::move(features));
  return TrackByImage(std::move(frame), std::move(features));
}

// ------------------------------------------------------------------------------------------------ poses that are given

TrackedImage Tracker::TakeGivenPose(std::shared_ptr<const Frame> frame) {
  TrackedImage image;
  image.tracked = given_.Take(frame);
  image.pose_given = pose_use_ == PoseUse::kGiven;
  image.generation = map_ ? map_->generation : 0;
  world_is_given_ = true;
  state_ = TrackingState::kTracking;
  const SE3<World, Camera>& pose = image.tracked.T_world_camera;
  if (last_pose_) {
    motion_ = last_pose_->Inverse() * pose;
    motion_s_ = 1e-9 * static_cast<double>(frame->timestamp_ns - last_timestamp_ns_);
  }
  last_pose_ = pose;
  last_prior_ = pose;
  last_timestamp_ns_ = frame->timestamp_ns;
  last_points_.clear();
  if (!image.pose_given) AnchorToReference(image.tracked);
  if (!image.tracked.is_keyframe) return image;
  image.features = MakeFrameFeatures(*frame, extractor_.Extract(*frame));
  image.points.resize(image.features->size());
  ++keyframes_sent_;
  return image;
}

// ------------------------------------------------------------------------------------------------ the first views

TrackedImage Tracker::Initialize(std::shared_ptr<const Frame> frame, std::shared_ptr<const FrameFeatures> features) {
  TrackedImage image;
  image.generation = map_ ? map_->generation : 0;
  image.tracked.frame = frame;
  image.tracked.state = TrackingState::kInitializing;
  image.features = features;
  if (waiting_for_map_) {
    image.tracked.reason = "the map is being made";
    return image;
  }
  const auto with_depth =
      std::count_if(features->ranges_mu.begin(), features->ranges_mu.end(), [](double r) { return r > 0; });
  if (with_depth >= kStartDepthPoints) {
    image.initial_views = InitialViews{.first = features};
    image.tracked.reason = "a view with depth, the map begins";
    monocular_initializer_.Reset();
  } else {
    image.initial_views = monocular_initializer_.Offer(features, &image.tracked.reason);
  }
  if (!image.initial_views) return image;
  waiting_for_map_ = true;
  waiting_generation_ = image.generation;
  world_is_given_ = false;
  keyframes_sent_ += image.initial_views->second ? 2 : 1;
  last_pose_.reset();
  motion_.reset();
  return image;
}

// ------------------------------------------------------------------------------------------------ tracking

void Tracker::TakeNewestMap() {
  const std::shared_ptr<const LocalMap> newest = slot_->Get();
  if (!newest || newest == map_) return;
  const bool was_reset = !map_ || newest->generation != map_->generation;
  if (was_reset) {
    if (waiting_for_map_ && newest->generation > waiting_generation_) {
      waiting_for_map_ = false;
      // The start's newest view is where the camera was a moment ago.
      if (!newest->points.empty()) {
        const auto reference = newest->keyframes.find(newest->reference);
        last_pose_ = reference->second.T_world_camera;
        state_ = TrackingState::kTracking;
        frames_since_found_ = 0;
      } else {
        state_ = TrackingState::kInitializing;
      }
      motion_.reset();
    } else if (newest->points.empty() && !world_is_given_) {
      state_ = TrackingState::kInitializing;
      monocular_initializer_.Reset();
      last_pose_.reset();
      motion_.reset();
    }
    keyframes_sent_ = std::max(keyframes_sent_, newest->keyframes_done);
  } else if (last_pose_ && !world_is_given_) {
    // The camera goes along with the keyframe it was tracked against.
    const auto before = map_->keyframes.find(map_->reference);
    const auto after = newest->keyframes.find(map_->reference);
    if (before != map_->keyframes.end() && after != newest->keyframes.end()) {
      const double scale = after->second.scale / before->second.scale;
      const SE3<Camera, Camera> T_reference_last = before->second.T_world_camera.Inverse() * *last_pose_;
      last_pose_ = ScaledPose{after->second.T_world_camera, scale}.Compose(T_reference_last);
      if (motion_) motion_ = ScaleTranslation(*motion_, scale);
    }
  }
  map_ = newest;
}

SE3<World, Camera> Tracker::Predict(const Frame& frame) const {
  if (pose_use_ == PoseUse::kPrior && frame.T_world_camera && last_prior_) {
    return *last_pose_ * (last_prior_->Inverse() * *frame.T_world_camera);
  }
  if (!motion_ || motion_s_ <= 0) return *last_pose_;
  const double gap_s = 1e-9 * static_cast<double>(frame.timestamp_ns - last_timestamp_ns_);
  if (gap_s > kLongestPrediction_s) return *last_pose_;
  const double share = gap_s / motion_s_;
  // Slerp extrapolates beyond 1; hands turn so little between two frames that this is the same turn going on.
  const Eigen::AngleAxisd turn(motion_->rotation());
  const Eigen::Quaterniond rotation(Eigen::AngleAxisd(share * turn.angle(), turn.axis()));
  return *last_pose_ * SE3<Camera, Camera>(rotation, share * motion_->translation());
}

TrackedImage Tracker::TrackByImage(std::shared_ptr<const Frame> frame, std::shared_ptr<const FrameFeatures> features) {
  TrackedImage image;
  image.tracked.frame = frame;
  image.tracked.up_world = map_->up_world;
  image.features = features;
  image.generation = map_->generation;
  if (features->size() < static_cast<size_t>(kMinFeatures)) {
    Lose(fmt::format("too little texture: {} features", features->size()), image);
    return image;
  }
  if (const std::optional<Attempt> attempt = FindCamera(*frame, *features)) {
    Accept(*frame, *features, *attempt, image);
  } else {
    Lose("the image does not fit the map", image);
  }
  return image;
}

std::optional<Tracker::Attempt> Tracker::FindCamera(const Frame& frame, const FrameFeatures& features) {
  std::optional<Attempt> first;
  if (last_pose_) {
    const bool lost = state_ == TrackingState::kLost;
    const SE3<World, Camera> start = lost ? *last_pose_ : Predict(frame);
    if (!lost) first = FollowLastPoints(features, start, kFollowRadius_px);
    if (!first) first = FollowLastPoints(features, start, kWideRadius_px);
    if (!first) first = FindByLooks(features);
  }
  if (first) {
    if (auto whole = UseWholeLocalMap(features, *first)) return whole;
  }
  return TrackNearRelocalization(features);
}

std::optional<Tracker::Attempt> Tracker::FollowLastPoints(const FrameFeatures& features,
                                                          const SE3<World, Camera>& start, double radius_px) const {
  std::vector<LocalPoint> points;
  std::vector<int> index_of;
  const auto take = [&](int index) {
    points.push_back(map_->points[static_cast<size_t>(index)]);
    index_of.push_back(index);
  };
  for (const MapPointId id : last_points_) {
    const auto it = map_->index.find(id);
    if (it != map_->index.end()) take(it->second);
  }
  if (points.size() < static_cast<size_t>(2 * kMinFirstInliers)) {
    points.clear();
    index_of.clear();
    for (size_t i = 0; i < map_->points.size(); ++i) take(static_cast<int>(i));
  }
  ProjectionMatcher matcher(features, start);
  const ProjectionSearch search{.radius_px = radius_px, .max_distance = kMaxDistance, .ratio = 0.9};
  std::vector<int> point_of_feature(features.size(), -1);
  for (const PointMatch& match : matcher.MatchAll(points, search, {})) {
    point_of_feature[static_cast<size_t>(match.feature)] = index_of[static_cast<size_t>(match.point)];
  }
  return Refine(features, start, std::move(point_of_feature), kMinFirstInliers);
}

std::optional<Tracker::Attempt> Tracker::FindByLooks(const FrameFeatures& features) const {
  std::vector<LocalPoint> points;
  std::vector<int> index_of;
  for (const MapPointId id : last_points_) {
    const auto it = map_->index.find(id);
    if (it == map_->index.end()) continue;
    points.push_back(map_->points[static_cast<size_t>(it->second)]);
    index_of.push_back(it->second);
  }
  std::vector<PoseObservation> observations;
  std::vector<PointMatch> matches = MatchByDescriptors(points, features, kMaxLooksDistance, kLooksRatio);
  for (const PointMatch& match : matches) {
    const Feature& feature = features.features[static_cast<size_t>(match.feature)];
    observations.push_back({.p_world = points[static_cast<size_t>(match.point)].position_world,
                            .pixel_px = feature.pixel_px.cast<double>(),
                            .sigma_px = config_.pixel_sigma_px * feature.octave_scale});
  }
  const auto pose = SolvePnp(features.camera, observations,
                             {.min_inliers = kMinFirstInliers, .seed = config_.Seed(features.frame_id)});
  if (!pose) return std::nullopt;
  std::vector<int> point_of_feature(features.size(), -1);
  for (size_t i = 0; i < matches.size(); ++i) {
    if (pose->inlier[i] == 0) continue;
    point_of_feature[static_cast<size_t>(matches[i].feature)] = index_of[static_cast<size_t>(matches[i].point)];
  }
  return Refine(features, pose->T_world_camera, std::move(point_of_feature), kMinFirstInliers);
}

std::optional<Tracker::Attempt> Tracker::TrackNearRelocalization(const FrameFeatures& features) const {
  if (state_ != TrackingState::kLost || !map_->relocalized || map_->relocalized->frame_id < lost_since_frame_) {
    return std::nullopt;
  }
  // The camera has moved on since that frame: all points, in a wide area.
  const SE3<World, Camera>& start = map_->relocalized->T_world_camera;
  ProjectionMatcher matcher(features, start);
  const ProjectionSearch search{.radius_px = kWideRadius_px, .max_distance = kMaxLooksDistance, .ratio = 0.8};
  std::vector<int> point_of_feature(features.size(), -1);
  for (const PointMatch& match : matcher.MatchAll(map_->points, search, {})) {
    point_of_feature[static_cast<size_t>(match.feature)] = match.point;
  }
  const auto first = Refine(features, start, std::move(point_of_feature), kMinFirstInliers);
  return first ? UseWholeLocalMap(features, *first) : std::nullopt;
}

std::optional<Tracker::Attempt> Tracker::UseWholeLocalMap(const FrameFeatures& features, const Attempt& first) const {
  std::vector<int> point_of_feature = first.point_of_feature;
  std::vector<uint8_t> taken(features.size(), 0);
  std::vector<uint8_t> seen(map_->points.size(), 0);
  for (size_t i = 0; i < point_of_feature.size(); ++i) {
    if (point_of_feature[i] < 0) continue;
    taken[i] = 1;
    seen[static_cast<size_t>(point_of_feature[i])] = 1;
  }
  ProjectionMatcher matcher(features, first.T_world_camera);
  const ProjectionSearch search{.radius_px = kLocalRadius_px, .max_distance = kMaxDistance, .ratio = 0.9};
  std::vector<int> distance_of(features.size(), 256);
  for (size_t p = 0; p < map_->points.size(); ++p) {
    if (seen[p] != 0) continue;
    const auto found = matcher.Find(map_->points[p], search, taken);
    if (!found || found->distance >= distance_of[static_cast<size_t>(found->feature)]) continue;
    distance_of[static_cast<size_t>(found->feature)] = found->distance;
    point_of_feature[static_cast<size_t>(found->feature)] = static_cast<int>(p);
  }
  const bool unproven = state_ == TrackingState::kLost || frames_since_found_ < kProvenAfter_frames;
  const int min_inliers = unproven ? kMinInliersAfterLoss : kMinInliers;
  auto attempt = Refine(features, first.T_world_camera, std::move(point_of_feature), min_inliers);
  if (attempt && attempt->inliers < kMinInlierShare * attempt->matches) return std::nullopt;
  if (attempt && last_pose_ && state_ == TrackingState::kTracking) {
    const double depth_mu = MedianDepth_mu(*map_, attempt->T_world_camera, attempt->point_of_feature);
    const double way_mu = (attempt->T_world_camera.translation() - last_pose_->translation()).norm();
    if (way_mu > kLongestDepartureShare * depth_mu) return std::nullopt;
  }
  return attempt;
}

std::optional<Tracker::Attempt> Tracker::Refine(const FrameFeatures& features, const SE3<World, Camera>& start,
                                                std::vector<int> point_of_feature, int min_inliers) const {
  std::vector<PoseObservation> observations;
  std::vector<size_t> feature_of;
  for (size_t i = 0; i < point_of_feature.size(); ++i) {
    if (point_of_feature[i] < 0) continue;
    const Feature& feature = features.features[i];
    PoseObservation observation{.p_world = map_->points[static_cast<size_t>(point_of_feature[i])].position_world,
                                .pixel_px = feature.pixel_px.cast<double>(),
                                .sigma_px = config_.pixel_sigma_px * feature.octave_scale};
    if (features.ranges_mu[i] > 0) {
      observation.depth_mu = features.ranges_mu[i] * features.bearings_camera[i].z();
      observation.depth_sigma_mu = config_.depth_sigma_ratio * observation.depth_mu;
    }
    observations.push_back(observation);
    feature_of.push_back(i);
  }
  if (observations.size() < static_cast<size_t>(min_inliers)) return std::nullopt;
  const PoseEstimate pose = RefinePose(features.camera, start, observations);
  if (pose.inliers < min_inliers || !pose.T_world_camera.IsFinite()) return std::nullopt;
  for (size_t i = 0; i < observations.size(); ++i) {
    if (pose.inlier[i] == 0) point_of_feature[feature_of[i]] = -1;
  }
  return Attempt{.T_world_camera = pose.T_world_camera,
                 .point_of_feature = std::move(point_of_feature),
                 .inliers = pose.inliers,
                 .matches = static_cast<int>(observations.size())};
}

// ------------------------------------------------------------------------------------------------ after the attempt

void Tracker::AnchorToReference(TrackedFrame& tracked) const {
  if (!map_) return;
  const auto reference = map_->keyframes.find(map_->reference);
  if (reference == map_->keyframes.end()) return;
  tracked.reference = map_->reference;
  tracked.T_reference_camera = reference->second.Relative(tracked.T_world_camera);
}

void Tracker::Accept(const Frame& frame, const FrameFeatures& features, const Attempt& attempt, TrackedImage& image) {
  const bool was_lost = state_ == TrackingState::kLost;
  frames_since_found_ = was_lost ? 0 : frames_since_found_ + 1;
  state_ = TrackingState::kTracking;
  image.tracked.state = was_lost ? TrackingState::kRelocalized : TrackingState::kTracking;
  image.tracked.T_world_camera = attempt.T_world_camera;
  AnchorToReference(image.tracked);

  motion_.reset();
  if (last_pose_ && !was_lost) {
    motion_ = last_pose_->Inverse() * attempt.T_world_camera;
    motion_s_ = 1e-9 * static_cast<double>(frame.timestamp_ns - last_timestamp_ns_);
  }
  last_pose_ = attempt.T_world_camera;
  last_prior_ = frame.T_world_camera;
  last_timestamp_ns_ = frame.timestamp_ns;
  last_points_.clear();
  for (const int point : attempt.point_of_feature) {
    if (point >= 0) last_points_.push_back(map_->points[static_cast<size_t>(point)].id);
  }
  image.tracked.is_keyframe = DecideKeyframe(frame, features, attempt);
  if (!image.tracked.is_keyframe) return;
  ++keyframes_sent_;
  image.points.resize(features.size());
  for (size_t i = 0; i < features.size(); ++i) {
    const int point = attempt.point_of_feature[i];
    if (point >= 0) image.points[i] = map_->points[static_cast<size_t>(point)].id;
  }
}

bool Tracker::DecideKeyframe(const Frame& frame, const FrameFeatures& features, const Attempt& attempt) {
  // A pose that was just found again must hold for a while before the map is built on it.
  if (frames_since_found_ < 2 && map_->keyframes_done > 4) return false;
  const uint64_t waiting = keyframes_sent_ - std::min(keyframes_sent_, map_->keyframes_done);
  TrackingQuality quality;
  quality.scene_depth_mu = MedianDepth_mu(*map_, attempt.T_world_camera, attempt.point_of_feature);
  quality.tracked_share = attempt.inliers / std::max(1.0, static_cast<double>(map_->reference_points));
  quality.keyframes_waiting = static_cast<int>(waiting);
  quality.has_unseen_depth = features.HasDepth() && attempt.inliers < 100;
  return selector_.IsKeyframe(frame, attempt.T_world_camera, quality);
}

void Tracker::Lose(const std::string& why, TrackedImage& image) {
  if (state_ != TrackingState::kLost) lost_since_frame_ = image.tracked.frame->frame_id;
  state_ = TrackingState::kLost;
  image.tracked.state = TrackingState::kLost;
  image.tracked.reason = why;
  motion_.reset();
}

}  // namespace romap::slam
