#include "server/objects/object_mapper.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/statistics.h"

namespace romap::objects {
namespace {

bool HasUsablePose(TrackingState state, const SE3<World, Camera>& T_world_camera) {
  const bool tracked = state == TrackingState::kTracking || state == TrackingState::kRelocalized;
  return tracked && T_world_camera.IsFinite();
}

std::vector<LandmarkKey> SortedUnique(std::vector<LandmarkKey> keys) {
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return keys;
}

}  // namespace

Landmark* ObjectMapper::FindLandmark(LandmarkKey key) {
  const auto found =
      std::find_if(landmarks_.begin(), landmarks_.end(), [&](const auto& landmark) { return landmark->key == key; });
  return found == landmarks_.end() ? nullptr : found->get();
}

ObjectOutput ObjectMapper::ObserveFrame(const TrackedFrame& tracked) {
  ObjectOutput output;
  current_ = {};
  if (!tracked.frame || !HasUsablePose(tracked.state, tracked.T_world_camera)) return output;
  history_.Add(tracked);
  // A frame on which no detector ran says nothing about what is or is not there.
  if (!tracked.frame->has_masks) return output;
  output = ObserveMaskedFrame(tracked);
  if (tracked.is_keyframe) return output;
  if (const auto stand_in = history_.StandIn(tracked, registry_)) output.Append(ObserveMaskedKeyframe(*stand_in));
  return output;
}

ObjectOutput ObjectMapper::ObserveLateMasks(const FrameMasks& masks) {
  current_ = {};
  auto masked = history_.TakeLateMasks(masks);
  if (!masked) {
    spdlog::debug("objects: late masks of frame {} are passed over", masks.frame_id);
    return {};
  }
  ObjectOutput output = ObserveMaskedFrame(masked->tracked);
  if (!masked->view) masked->view = history_.StandIn(masked->tracked, registry_);
  if (masked->view) output.Append(ObserveMaskedKeyframe(*masked->view));
  return output;
}

ObjectOutput ObjectMapper::ObserveMaskedFrame(const TrackedFrame& tracked) {
  ObjectOutput output;
  current_.usable = true;
  current_.frame_id = tracked.frame->frame_id;
  ++frame_index_;
  current_.detections = ExtractDetections(*tracked.frame, config_);
  const Association association =
      Associate(tracked, current_.detections, landmarks_, frame_index_, scene_depth_mu_, config_);
  const size_t landmarks_before = landmarks_.size();
  UpdateLost(association, &output);
  for (size_t d = 0; d < current_.detections.size(); ++d) {
    const Match& match = association.matches[d];
    current_.certain.push_back(match.doubt == nullptr);
    if (match.landmark < 0 && match.doubt != nullptr) {
      current_.keys.push_back(kNobody);
      continue;
    }
    if (match.landmark < 0) {
      landmarks_.push_back(std::make_unique<Landmark>(++last_key_, config_));
      spdlog::debug("objects: frame {}: label {} ({}) is a new landmark {}", current_.frame_id,
                    current_.detections[d].label, current_.detections[d].class_name, last_key_);
    }
    Landmark& landmark = match.landmark < 0 ? *landmarks_.back() : *landmarks_[static_cast<size_t>(match.landmark)];
    current_.keys.push_back(landmark.key);
    if (match.agreement) {
      landmark.agreement_sum += *match.agreement;
      ++landmark.agreement_count;
    }
    RecordSighting(landmark, current_.detections[d], tracked);
    if (landmark.state == ObjectState::kLost) {
      landmark.state = ObjectState::kConfirmed;
      Publish(landmark, /*force=*/true, &output);
    }
  }
  RecordCompany(association, landmarks_before);
  BuryGhosts(&output);
  return output;
}

void ObjectMapper::RecordSighting(Landmark& landmark, const Detection& detection, const TrackedFrame& tracked) {
  landmark.last_frame = frame_index_;
  landmark.missed_in_view = 0;
  ++landmark.sightings;
  ++landmark.expected;
  landmark.last_box_px = detection.box_px;
  landmark.last_T_world_camera = tracked.T_world_camera;
  landmark.last_track_id = detection.track_id;
  landmark.class_evidence[detection.class_name] += detection.score;
}

void ObjectMapper::RecordCompany(const Association& association, size_t landmarks_before) {
  for (size_t i = 0; i < current_.keys.size(); ++i) {
    if (current_.keys[i] == kNobody) continue;
    Landmark& landmark = *FindLandmark(current_.keys[i]);
    for (size_t j = 0; j < current_.keys.size(); ++j) {
      if (i != j && current_.keys[j] != kNobody) ++landmark.seen_beside[current_.keys[j]];
    }
  }
  for (size_t l = 0; l < landmarks_before; ++l) {
    const int cover = association.covered_by[l];
    if (cover >= 0) ++landmarks_[l]->covered_by[landmarks_[static_cast<size_t>(cover)]->key];
  }
}

void ObjectMapper::UpdateLost(const Association& association, ObjectOutput* output) {
  constexpr double kPlainlyVisible = 0.6;
  std::vector<bool> matched(landmarks_.size(), false);
  for (const Match& match : association.matches) {
    if (match.landmark >= 0) matched[static_cast<size_t>(match.landmark)] = true;
  }
  for (size_t l = 0; l < landmarks_.size(); ++l) {
    Landmark& landmark = *landmarks_[l];
    if (matched[l] || association.visible_share[l] < kPlainlyVisible) continue;
    ++landmark.expected;
    ++landmark.missed_in_view;
    if (landmark.state != ObjectState::kConfirmed || landmark.missed_in_view < config_.lost_after_frames) continue;
    landmark.state = ObjectState::kLost;
    spdlog::debug("objects: {} is lost: missed {} times in plain view", landmark.id.ToString(),
                  landmark.missed_in_view);
    Publish(landmark, /*force=*/true, output);
  }
}

void ObjectMapper::BuryGhosts(ObjectOutput* output) {
  Bury([&](const Landmark& landmark) { return WhyGhost(landmark); }, output);
}

void ObjectMapper::Bury(const std::function<const char*(const Landmark&)>& why, ObjectOutput* output) {
  std::erase_if(landmarks_, [&](const auto& landmark) {
    const char* reason = why(*landmark);
    if (reason == nullptr) return false;
    spdlog::debug("objects: landmark {} goes: {} ({} sightings, {} expected)", landmark->key, reason,
                  landmark->sightings, landmark->expected);
    if (landmark->published) {
      output->events.emplace_back(ObjectRemoved{.id = landmark->id, .reason = reason});
    }
    return true;
  });
}

// Why a landmark is no thing; nullptr: it may be one.
const char* ObjectMapper::WhyGhost(const Landmark& landmark) const {
  if (landmark.state == ObjectState::kLost) {
    return static_cast<double>(landmark.sightings) < config_.confirm_seen_share * static_cast<double>(landmark.expected)
               ? "it was seen too seldom where it ought to be"
               : nullptr;
  }
  if (landmark.state != ObjectState::kProvisional) return nullptr;
  constexpr uint64_t kMostlyCovered = 3;
  for (const auto& [key, count] : landmark.covered_by) {
    if (count > kMostlyCovered * std::max<uint64_t>(landmark.sightings, 3)) return "it is a piece of another thing";
  }
  // What was seen often and then left the view may come back; what was seen twice will not.
  const uint64_t unseen = frame_index_ - landmark.last_frame;
  constexpr int kPatienceFrames = 40;
  constexpr uint64_t patience = kPatienceFrames;
  if (landmark.missed_in_view >= kPatienceFrames) return "it is not where it was seen";
  return unseen > (landmark.cuboid ? 10 * patience : patience) ? "it was not seen again" : nullptr;
}

ObjectOutput ObjectMapper::ObserveKeyframe(const KeyframeView& view) {
  ObjectOutput output;
  registry_.UpdatePositions(view);
  if (!view.frame || !view.T_world_camera.IsFinite()) return output;
  history_.AddKeyframe(view);
  // Not from late views: what they say of up may have been corrected since.
  if (view.up_world.allFinite() && view.up_world.norm() > 0.5) up_world_ = view.up_world.normalized();
  if (!current_.usable || view.frame->frame_id != current_.frame_id) return output;
  return ObserveMaskedKeyframe(view);
}

ObjectOutput ObjectMapper::ObserveMaskedKeyframe(const KeyframeView& view) {
  ObjectOutput output;
  CountPointVotes(view);
  UpdateSceneDepth(view);
  CollectSilhouettes(view);
  OfferViews(view);
  std::vector<LandmarkKey> changed = FitNeediest();
  changed.insert(changed.end(), current_.keys.begin(), current_.keys.end());
  changed = SortedUnique(std::move(changed));
  std::erase(changed, kNobody);
  ConfirmProven(changed);
  MergeDuplicates(&output);
  PublishAll(changed, &output);
  return output;
}

ObjectOutput ObjectMapper::Finish() {
  ObjectOutput output;
  std::vector<LandmarkKey> keys;
  for (const auto& landmark : landmarks_) keys.push_back(landmark->key);
  FitAll();
  ConfirmProven(keys);
  MergeDuplicates(&output);
  Bury(
      [](const Landmark& landmark) {
        return landmark.state == ObjectState::kProvisional ? "it never got sure" : nullptr;
      },
      &output);
  ObjectOutput last;
  PublishAll(keys, &last);
  for (const auto& landmark : landmarks_) {
    // Small corrections that waited for more.
    if (landmark->published && landmark->S_now_told) Publish(*landmark, /*force=*/true, &last);
  }
  output.Append(std::move(last));
  return output;
}

void ObjectMapper::CountPointVotes(const KeyframeView& view) {
  std::map<uint16_t, LandmarkKey> key_of_label{{0, kBackgroundKey}};
  for (size_t d = 0; d < current_.detections.size(); ++d) {
    if (current_.certain[d]) key_of_label[current_.detections[d].label] = current_.keys[d];
  }
  const CameraModel& camera = view.frame->camera;
  const cv::Mat& labels = view.frame->labels;
  for (const PointObservation& observation : view.observations) {
    // A label of 0 may also mean "too close to the border of a mask to tell": no evidence for the background.
    if (observation.label == 0 && !labels.empty()) {
      const int u = std::clamp(static_cast<int>(std::lround(observation.pixel_px.x())), 0, camera.width_px - 1);
      const int v = std::clamp(static_cast<int>(std::lround(observation.pixel_px.y())), 0, camera.height_px - 1);
      if (labels.at<uint16_t>(v, u) != 0) continue;
    }
    const auto key = key_of_label.find(observation.label);
    if (key != key_of_label.end()) registry_.Vote(observation.point, key->second);
  }
}

void ObjectMapper::UpdateSceneDepth(const KeyframeView& view) {
  const SE3<Camera, World> T_camera_world = view.T_world_camera.Inverse();
  std::vector<double> depths;
  for (const MapPoint& point : view.points) {
    const double z_mu = (T_camera_world * point.position_world).z();
    if (z_mu > 0) depths.push_back(z_mu);
  }
  if (depths.empty()) return;
  last_keyframe_ = view.id;
  scene_depth_mu_ = Median(std::move(depths));
}

}  // namespace romap::objects
