#include "server/slam/slam_map.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>
#include <utility>

#include "common/statistics.h"

namespace romap::slam {
namespace {

size_t ObservationIndex(const PointTrack& track, KeyframeId keyframe) {
  const auto it = std::find_if(track.observations.begin(), track.observations.end(),
                               [&](const FeatureRef& observation) { return observation.keyframe == keyframe; });
  return static_cast<size_t>(it - track.observations.begin());
}

}  // namespace

bool PointTrack::IsObservedBy(KeyframeId keyframe) const {
  return ObservationIndex(*this, keyframe) < observations.size();
}

MapKeyframe& SlamMap::AddKeyframe(std::shared_ptr<const FrameFeatures> frame,
                                  const SE3<World, Camera>& T_world_camera) {
  const KeyframeId id{++keyframe_count_};
  MapKeyframe& keyframe = keyframes_[id];
  keyframe.id = id;
  keyframe.points.resize(frame->size());
  keyframe.scene_features = frame->size();
  keyframe.frame = WithLens(std::move(frame), lens_);
  keyframe.SetPose(T_world_camera);
  return keyframe;
}

PointTrack& SlamMap::AddPoint(const Eigen::Vector3d& position_world) {
  const MapPointId id{++point_count_};
  PointTrack& track = points_[id];
  track.point.id = id;
  track.point.position_world = position_world;
  track.created_keyframe = keyframe_count_;
  return track;
}

bool SlamMap::AddObservation(PointTrack& track, MapKeyframe& keyframe, int feature) {
  MapPointId& observed = keyframe.points[static_cast<size_t>(feature)];
  if (observed || track.IsObservedBy(keyframe.id)) return false;
  observed = track.point.id;
  const auto after = std::find_if(track.observations.begin(), track.observations.end(),
                                  [&](const FeatureRef& observation) { return observation.keyframe > keyframe.id; });
  track.observations.insert(after, {keyframe.id, feature});
  track.point.observations = static_cast<int>(track.observations.size());
  track.latest_keyframe = std::max(track.latest_keyframe, keyframe.id.value);
  return true;
}

void SlamMap::RemoveObservation(MapPointId point, KeyframeId keyframe_id) {
  PointTrack* track = FindPoint(point);
  if (track == nullptr) return;
  const size_t index = ObservationIndex(*track, keyframe_id);
  if (index == track->observations.size()) return;
  MapKeyframe& keyframe = keyframes_.at(keyframe_id);
  const auto feature = static_cast<size_t>(track->observations[index].feature);
  keyframe.points[feature] = {};
  track->observations.erase(track->observations.begin() + static_cast<std::ptrdiff_t>(index));
  track->point.observations = static_cast<int>(track->observations.size());
  const auto has_depth = [&](const FeatureRef& observation) {
    return keyframes_.at(observation.keyframe).frame->ranges_mu[static_cast<size_t>(observation.feature)] > 0;
  };
  const bool is_determined =
      track->observations.size() >= 2 || (track->observations.size() == 1 && has_depth(track->observations[0]));
  if (!is_determined) RemovePoint(track->point.id);
}

void SlamMap::RemovePoint(MapPointId point) {
  const auto it = points_.find(point);
  if (it == points_.end()) return;
  for (const FeatureRef& observation : it->second.observations) {
    keyframes_.at(observation.keyframe).points[static_cast<size_t>(observation.feature)] = {};
  }
  points_.erase(it);
  removed_points_.push_back(point);
}

void SlamMap::MergePoints(MapPointId from, MapPointId into) {
  const auto source = points_.find(from);
  PointTrack* target = FindPoint(into);
  if (source == points_.end() || target == nullptr || target->point.id == from) return;
  const std::vector<FeatureRef> observations = source->second.observations;
  target->votes.Add(source->second.votes);
  RemovePoint(from);
  merged_into_[from] = target->point.id;
  for (const FeatureRef& observation : observations)
    AddObservation(*target, keyframes_.at(observation.keyframe), observation.feature);
  Refresh(*target);
}

void SlamMap::RemoveKeyframe(KeyframeId id) {
  MapKeyframe& keyframe = keyframes_.at(id);
  const std::vector<MapPointId> points = keyframe.points;
  for (const MapPointId point : points) {
    if (point) RemoveObservation(point, id);
  }
  const MapKeyframe& parent = keyframes_.at(keyframe.parent);
  removed_keyframes_[id] = {.parent = parent.id,
                            .T_parent_this = parent.scaled_pose().Relative(keyframe.T_world_camera()),
                            .relative_scale = keyframe.scale / parent.scale};
  for (auto& [other_id, other] : keyframes_) {
    if (other.parent == id) other.parent = parent.id;
    std::erase_if(other.loops, [&](const auto& loop) { return loop.first == id; });
  }
  keyframes_.erase(id);
}

PointTrack* SlamMap::FindPoint(MapPointId point) {
  for (auto it = merged_into_.find(point); it != merged_into_.end(); it = merged_into_.find(point)) point = it->second;
  const auto it = points_.find(point);
  return it == points_.end() ? nullptr : &it->second;
}

MapKeyframe* SlamMap::FindKeyframe(KeyframeId keyframe) {
  const auto it = keyframes_.find(keyframe);
  return it == keyframes_.end() ? nullptr : &it->second;
}

std::optional<ScaledPose> SlamMap::KeyframePose(KeyframeId id) const {
  if (const MapKeyframe* keyframe = FindKeyframe(id)) return keyframe->scaled_pose();
  const auto removed = removed_keyframes_.find(id);
  if (removed == removed_keyframes_.end()) return std::nullopt;
  const std::optional<ScaledPose> parent = KeyframePose(removed->second.parent);
  if (!parent) return std::nullopt;
  return ScaledPose{parent->Compose(removed->second.T_parent_this), parent->scale * removed->second.relative_scale};
}

std::optional<PoseUncertainty> SlamMap::KeyframeUncertainty(KeyframeId id) const {
  if (const MapKeyframe* keyframe = FindKeyframe(id)) return keyframe->uncertainty;
  const auto removed = removed_keyframes_.find(id);
  return removed == removed_keyframes_.end() ? std::nullopt : KeyframeUncertainty(removed->second.parent);
}

std::vector<std::pair<KeyframeId, int>> SlamMap::Covisible(const MapKeyframe& keyframe, int min_shared) const {
  std::unordered_map<KeyframeId, int> shared;
  for (const MapPointId point : keyframe.points) {
    if (!point) continue;
    for (const FeatureRef& observation : points_.at(point).observations) ++shared[observation.keyframe];
  }
  shared.erase(keyframe.id);
  std::vector<std::pair<KeyframeId, int>> neighbors;
  for (const auto& [id, count] : shared) {
    if (count >= min_shared) neighbors.emplace_back(id, count);
  }
  std::sort(neighbors.begin(), neighbors.end(),
            [](const auto& a, const auto& b) { return std::pair(a.second, a.first) > std::pair(b.second, b.first); });
  return neighbors;
}

std::optional<double> SlamMap::MedianDepth_mu(const MapKeyframe& keyframe) const {
  std::vector<double> depths_mu;
  for (const MapPointId id : keyframe.points) {
    if (id) depths_mu.push_back((keyframe.T_camera_world() * FindPoint(id)->point.position_world).z());
  }
  if (depths_mu.empty()) return std::nullopt;
  return Median(std::move(depths_mu));
}

ObservedRay SlamMap::RayOf(const MapKeyframe& keyframe, int feature) const {
  const auto i = static_cast<size_t>(feature);
  const double range_mu = keyframe.frame->ranges_mu[i];
  return {.center_world = keyframe.center_world(),
          .bearing_world = keyframe.BearingWorld(i),
          .bearing_sigma_rad = config_.pixel_sigma_px * keyframe.features()[i].octave_scale / keyframe.camera().fx_px,
          .range_mu = range_mu,
          .range_sigma_mu = config_.depth_sigma_ratio * range_mu};
}

std::vector<ObservedRay> SlamMap::RaysOf(const PointTrack& track, size_t max_rays) const {
  std::vector<ObservedRay> rays;
  const size_t count = track.observations.size();
  const size_t taken = std::min(count, max_rays);
  rays.reserve(taken);
  for (size_t i = 0; i < taken; ++i) {
    // Spread over time, the first and the newest among them.
    const FeatureRef& observation = track.observations[taken < 2 ? 0 : i * (count - 1) / (taken - 1)];
    rays.push_back(RayOf(keyframes_.at(observation.keyframe), observation.feature));
  }
  return rays;
}

void SlamMap::Refresh(PointTrack& track) const {
  if (track.observations.empty()) return;
  constexpr size_t kMaxSamples = 12;
  const size_t count = track.observations.size();
  const size_t samples = std::min(count, kMaxSamples);
  std::vector<Descriptor> descriptors;
  Eigen::Vector3d directions = Eigen::Vector3d::Zero();
  std::vector<Eigen::Vector3d> rays;
  for (size_t i = 0; i < samples; ++i) {
    const FeatureRef& observation = track.observations[samples < 2 ? 0 : i * (count - 1) / (samples - 1)];
    const MapKeyframe& keyframe = keyframes_.at(observation.keyframe);
    descriptors.push_back(keyframe.features()[static_cast<size_t>(observation.feature)].descriptor);
    rays.push_back((track.point.position_world - keyframe.center_world()).normalized());
    directions += rays.back();
  }
  track.direction_world = directions.normalized();
  double min_cosine = 1;
  for (size_t i = 0; i < rays.size(); ++i) {
    for (size_t k = 0; k < i; ++k) min_cosine = std::min(min_cosine, rays[i].dot(rays[k]));
  }
  track.point.max_parallax_rad = std::acos(std::clamp(min_cosine, -1.0, 1.0));

  const FeatureRef& newest = track.observations.back();
  const MapKeyframe& keyframe = keyframes_.at(newest.keyframe);
  const Feature& feature = keyframe.features()[static_cast<size_t>(newest.feature)];
  track.size_mu =
      feature.octave_scale * (track.point.position_world - keyframe.center_world()).norm() / keyframe.camera().fx_px;

  int min_sum = std::numeric_limits<int>::max();
  for (size_t i = 0; i < samples; ++i) {
    int sum = 0;
    for (const Descriptor& other : descriptors) sum += HammingDistance(descriptors[i], other);
    if (sum >= min_sum) continue;
    min_sum = sum;
    track.descriptor = descriptors[i];
  }
}

void SlamMap::ConvertByDepth(MapKeyframe& keyframe) const {
  if (!keyframe.frame->shutter) return;
  std::vector<double> depths_mu(keyframe.points.size(), 0);
  for (size_t i = 0; i < depths_mu.size(); ++i) {
    if (!keyframe.points[i]) continue;
    const double depth_mu = (keyframe.T_camera_world() * FindPoint(keyframe.points[i])->point.position_world).z();
    depths_mu[i] = std::max(0.0, depth_mu / keyframe.scale);
  }
  keyframe.frame = WithShutterDepths(*keyframe.frame, std::move(depths_mu));
}

void SlamMap::CorrectLens(const RadialCorrection& lens) {
  lens_ = lens;
  for (auto& [id, keyframe] : keyframes_) keyframe.frame = WithLens(keyframe.frame, lens);
}

void SlamMap::Append(SlamMap other) {
  for (auto& [id, keyframe] : other.keyframes_) keyframe.frame = WithLens(keyframe.frame, lens_);
  keyframes_.merge(other.keyframes_);
  points_.merge(other.points_);
  merged_into_.merge(other.merged_into_);
  removed_keyframes_.merge(other.removed_keyframes_);
  removed_points_.insert(removed_points_.end(), other.removed_points_.begin(), other.removed_points_.end());
  SkipIds(other.keyframe_count_, other.point_count_);
}

void SlamMap::SkipIds(uint64_t keyframes_used, uint64_t points_used) {
  keyframe_count_ = std::max(keyframe_count_, keyframes_used);
  point_count_ = std::max(point_count_, points_used);
}

void SlamMap::Transform(const Sim3<World, World>& S_new_old) {
  for (auto& [id, keyframe] : keyframes_) {
    keyframe.SetPose(S_new_old.Moved(keyframe.T_world_camera()));
    keyframe.scale *= S_new_old.scale();
    keyframe.uncertainty.position_sigma_mu *= S_new_old.scale();
  }
  for (auto& [id, track] : points_) {
    track.point.position_world = S_new_old * track.point.position_world;
    track.direction_world = S_new_old.rotation() * track.direction_world;
    track.size_mu *= S_new_old.scale();
  }
}

}  // namespace romap::slam
