#include "server/objects/landmark_store.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <utility>

#include "common/map_motion.h"

namespace romap::objects {
namespace {

// Moves the count of `from` to `into` in the counts of landmark `owner`.
void RenameKey(LandmarkKey from, LandmarkKey into, LandmarkKey owner, std::map<LandmarkKey, uint64_t>* counts) {
  const auto old = counts->find(from);
  if (old == counts->end()) return;
  if (owner != into) (*counts)[into] += old->second;
  counts->erase(old);
}

void AddEvidence(const LandmarkEvidence& from, LandmarkKey into_key, LandmarkEvidence* into) {
  for (const auto& [name, evidence] : from.class_evidence) into->class_evidence[name] += evidence;
  for (const auto& [key, count] : from.observed_with) into->observed_with[key] += count;
  for (const auto& [key, count] : from.covered_by) into->covered_by[key] += count;
  into->observed_with.erase(into_key);
  into->covered_by.erase(into_key);
  into->observations += from.observations;
  into->expected += from.observations;
  into->keyframe_observations += from.keyframe_observations;
  into->whole_observations += from.whole_observations;
}

// Whether a corner of the object's outline may be detected at this pixel. Corners of the coarsest octave are displaced
// by up to the radius of their neighborhood. In small images, less must do, or no background would remain.
bool IsNearMask(const cv::Mat& labels, int u, int v) {
  constexpr int kReach_px = 12;
  constexpr int kMinReaches = 50;  // across the image
  const int reach_px = std::min(kReach_px, labels.cols / kMinReaches);
  const cv::Rect around(u - reach_px, v - reach_px, 2 * reach_px + 1, 2 * reach_px + 1);
  return cv::countNonZero(labels(around & cv::Rect({}, labels.size()))) > 0;
}

// The point at which MeanMotion() averages.
Eigen::Vector3d CenterOf(const Landmark& landmark) {
  const LandmarkGeometry& geometry = landmark.geometry;
  if (geometry.cuboid) return geometry.cuboid->T_world_object.translation();
  if (geometry.body_world.empty()) return landmark.last_T_world_camera.translation();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : geometry.body_world) sum += p;
  return sum / static_cast<double>(geometry.body_world.size());
}

}  // namespace

std::vector<LandmarkKey> LandmarkStore::Keys() const {
  std::vector<LandmarkKey> keys;
  for (const auto& landmark : landmarks_) keys.push_back(landmark->key);
  return keys;
}

Landmark* LandmarkStore::Find(LandmarkKey key) const {
  const auto found =
      std::find_if(landmarks_.begin(), landmarks_.end(), [&](const auto& landmark) { return landmark->key == key; });
  return found == landmarks_.end() ? nullptr : found->get();
}

Landmark& LandmarkStore::Create() {
  Landmark& landmark = *landmarks_.emplace_back(std::make_unique<Landmark>(++last_key_, config_));
  landmark.map = map_;
  return landmark;
}

void LandmarkStore::RemoveIf(const std::function<bool(const Landmark&)>& condition) {
  std::erase_if(landmarks_, [&](const auto& landmark) { return condition(*landmark); });
}

std::vector<SparseMapId> LandmarkStore::Maps() const {
  std::vector<SparseMapId> maps;
  for (const auto& [map, parts] : dormant_) maps.push_back(map);
  maps.push_back(map_);
  return maps;
}

void LandmarkStore::SetMap(SparseMapId map, uint64_t frame_index) {
  if (map == map_) return;
  if (!landmarks_.empty() || !points_.IsEmpty()) {
    dormant_[map_] = {
        .landmarks = std::exchange(landmarks_, {}), .points = std::exchange(points_, {}), .since_frame = frame_index};
  }
  map_ = map;
  WakeUp(map, frame_index);
}

// Adds what belongs to a dormant map to the current one.
void LandmarkStore::WakeUp(SparseMapId map, uint64_t frame_index) {
  auto found = dormant_.extract(map);
  if (found.empty()) return;
  DormantMap& woken = found.mapped();
  for (auto& landmark : woken.landmarks) {
    landmark->evidence.dormant_frames += frame_index - woken.since_frame;
    landmark->map = map_;
    landmarks_.push_back(std::move(landmark));
  }
  points_.Append(std::move(woken.points));
}

void LandmarkStore::MergeMaps(const MapMerge& merge, uint64_t frame_index) {
  if (merge.from == map_ || merge.into == map_) {
    map_ = merge.into;
    for (const auto& landmark : landmarks_) landmark->map = map_;
    WakeUp(merge.from, frame_index);
    WakeUp(merge.into, frame_index);
    return;
  }
  const SparseMapId current = map_;
  SetMap(merge.into, frame_index);
  WakeUp(merge.from, frame_index);
  SetMap(current, frame_index);
}

std::vector<Landmark*> LandmarkStore::DormantLandmarks() const {
  std::vector<Landmark*> landmarks;
  for (const auto& [map, parts] : dormant_) {
    for (const auto& landmark : parts.landmarks) landmarks.push_back(landmark.get());
  }
  return landmarks;
}

void LandmarkStore::MovePoints(const std::vector<MapPoint>& points) {
  points_.MovePoints(points);
  for (auto& [map, parts] : dormant_) parts.points.MovePoints(points);
}

void LandmarkStore::CountPointVotes(const KeyframeView& view, const FrameDetections& frame) {
  std::map<uint16_t, LandmarkKey> key_of_label{{0, kBackgroundKey}};
  for (size_t d = 0; d < frame.detections.size(); ++d) {
    if (frame.unambiguous[d]) key_of_label[frame.detections[d].label] = frame.keys[d];
  }
  const CameraModel& camera = view.frame->camera;
  const cv::Mat& labels = view.frame->labels;
  for (const PointObservation& observation : view.observations) {
    // An observation near the border of a mask also has label 0, but is no evidence for the background.
    if (observation.label == 0 && !labels.empty()) {
      const int u = std::clamp(static_cast<int>(std::lround(observation.pixel_px.x())), 0, camera.width_px - 1);
      const int v = std::clamp(static_cast<int>(std::lround(observation.pixel_px.y())), 0, camera.height_px - 1);
      if (labels.at<uint16_t>(v, u) != 0) continue;
      if (IsNearMask(labels, u, v)) {
        points_.Vote(observation.point, kOutlineKey);
        continue;
      }
    }
    const auto key = key_of_label.find(observation.label);
    if (key != key_of_label.end()) points_.Vote(observation.point, key->second);
  }
}

void LandmarkStore::SetUp(const Eigen::Vector3d& up_world) {
  constexpr double kMinLength = 0.5;  // a shorter vector does not define a direction
  if (up_world.allFinite() && up_world.norm() > kMinLength) up_world_ = up_world.normalized();
}

void LandmarkStore::CountCoVisibility(const FrameDetections& frame, const std::vector<int>& covered_by) {
  for (size_t i = 0; i < frame.keys.size(); ++i) {
    if (frame.keys[i] == kNoLandmark) continue;
    Landmark& landmark = *Find(frame.keys[i]);
    for (size_t j = 0; j < frame.keys.size(); ++j) {
      if (i != j && frame.keys[j] != kNoLandmark) ++landmark.evidence.observed_with[frame.keys[j]];
    }
  }
  for (size_t l = 0; l < covered_by.size(); ++l) {
    if (covered_by[l] < 0) continue;
    ++landmarks_[l]->evidence.covered_by[landmarks_[static_cast<size_t>(covered_by[l])]->key];
  }
}

void LandmarkStore::Merge(Landmark& from, Landmark& into, bool adopt_silhouettes) {
  points_.Merge(from.key, into.key);
  if (adopt_silhouettes) {
    for (const Silhouette& silhouette : from.shape.silhouettes()) {
      into.needs_fit |= into.shape.AddSilhouette(silhouette);
    }
  }
  AddEvidence(from.evidence, into.key, &into.evidence);
  into.keyframes.insert(into.keyframes.end(), from.keyframes.begin(), from.keyframes.end());
  into.evidence.first_frame_id = std::min(from.evidence.first_frame_id, into.evidence.first_frame_id);
  if (from.evidence.last_frame > into.evidence.last_frame) {
    into.evidence.last_frame = from.evidence.last_frame;
    into.evidence.dormant_frames = from.evidence.dormant_frames;
    into.evidence.missed_in_view = from.evidence.missed_in_view;
    into.last_box_px = from.last_box_px;
    into.last_T_world_camera = from.last_T_world_camera;
    into.last_track_id = from.last_track_id;
  }
  for (const auto& landmark : landmarks_) {
    if (landmark.get() == &from) continue;
    RenameKey(from.key, into.key, landmark->key, &landmark->evidence.observed_with);
    RenameKey(from.key, into.key, landmark->key, &landmark->evidence.covered_by);
  }
}

void LandmarkStore::RemoveMerged(LandmarkKey from, LandmarkKey into) {
  const auto position = [&](LandmarkKey key) {
    return std::find_if(landmarks_.begin(), landmarks_.end(),
                        [&](const auto& landmark) { return landmark->key == key; });
  };
  auto removed = position(from);
  const auto kept = position(into);
  if (removed < kept) {
    std::swap(*removed, *kept);
    removed = kept;
  }
  landmarks_.erase(removed);
}

std::optional<Sim3<World, World>> LandmarkStore::Correct(Landmark& landmark,
                                                         const KeyframeCorrections& keyframes) const {
  const auto S_new_old = MeanMotion(landmark.keyframes, CenterOf(landmark), keyframes);
  LandmarkGeometry& geometry = landmark.geometry;
  if (S_new_old) {
    if (geometry.cuboid) geometry.cuboid = Moved(*S_new_old, *geometry.cuboid);
    if (geometry.training_box) geometry.training_box = Moved(*S_new_old, *geometry.training_box);
    for (Eigen::Vector3d& p : geometry.body_world) p = *S_new_old * p;
    landmark.last_T_world_camera = S_new_old->Moved(landmark.last_T_world_camera);
  }
  const bool is_dormant = landmark.map != map_;
  if (is_dormant && !S_new_old) return std::nullopt;
  // The up direction may change even if no keyframe of this landmark was corrected.
  if (geometry.cuboid) geometry.cuboid = Upright(*geometry.cuboid, up_world_);
  if (geometry.training_box) geometry.training_box = Upright(*geometry.training_box, up_world_);
  if (S_new_old) landmark.needs_fit |= landmark.shape.Correct(*S_new_old, keyframes, geometry.cuboid);
  return S_new_old;
}

}  // namespace romap::objects
