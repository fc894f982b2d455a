#include "server/objects/object_mapper.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "common/angles.h"
#include "server/objects/landmark_decisions.h"
#include "server/objects/projection.h"

namespace romap::objects {
namespace {

using When = ObjectPublisher::When;

bool HasUsablePose(TrackingState state, const SE3<World, Camera>& T_world_camera) {
  const bool tracked = state == TrackingState::kTracking || state == TrackingState::kRelocalized;
  return tracked && T_world_camera.IsFinite();
}

// The landmarks to process after a keyframe, in the order of their keys.
std::vector<LandmarkKey> ChangedLandmarks(std::vector<LandmarkKey> fitted, const FrameDetections& frame) {
  std::vector<LandmarkKey> keys = std::move(fitted);
  keys.insert(keys.end(), frame.keys.begin(), frame.keys.end());
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  std::erase(keys, kNoLandmark);
  return keys;
}

KeyframeCorrections UsableCorrections(const MapCorrection& correction) {
  KeyframeCorrections keyframes;
  for (const KeyframeCorrection& keyframe : correction.keyframes) {
    if (keyframe.T_world_camera.IsFinite() && keyframe.S_new_old.IsFinite()) keyframes[keyframe.id] = keyframe;
  }
  return keyframes;
}

}  // namespace

ObjectMapper::ObjectMapper(const ObjectsConfig& config)
    : config_(config), store_(config), publisher_(config), fitter_(config), history_(config.max_mask_delay_s) {}

ObjectOutput ObjectMapper::ObserveFrame(const TrackedFrame& tracked) {
  current_ = {};
  ObjectOutput output;
  if (tracked.contradicted_since_frame != 0) output = RemoveContradicted(tracked);
  if (!tracked.frame) return output;
  const bool has_pose = HasUsablePose(tracked.state, tracked.T_world_camera);
  if (!tracked.frame->instances.empty()) confirmation_.CountMaskedFrame(has_pose);
  if (!has_pose) return output;
  SetMap(tracked.map);
  history_.Add(tracked);
  // If no detector ran on a frame, the frame is no evidence that objects are missing.
  if (!tracked.frame->has_masks) return output;
  output.Append(ObserveMaskedFrame(tracked));
  if (tracked.is_keyframe) return output;
  const auto stand_in = history_.MakeStandIn(tracked, store_.points());
  if (stand_in) output.Append(ObserveMaskedKeyframe(*stand_in));
  return output;
}

// Also confirmed ones: their cuboids follow from wrong poses or depths.
ObjectOutput ObjectMapper::RemoveContradicted(const TrackedFrame& tracked) {
  ObjectOutput output;
  SetMap(tracked.map);
  history_.ForgetFrames();
  scene_depth_ = {};
  Prune(
      [&](const Landmark& landmark) {
        return Decision{landmark.evidence.first_frame_id >= tracked.contradicted_since_frame,
                        "the given poses or depth images contradict the images"};
      },
      &output);
  return output;
}

void ObjectMapper::SetMap(SparseMapId map) {
  if (map == store_.map()) return;
  store_.SetMap(map, frame_index_);
  history_.ForgetFrames();
  scene_depth_ = {};
}

ObjectOutput ObjectMapper::ObserveKeyframe(const KeyframeView& view) {
  store_.UpdatePoints(view);
  if (!view.frame || !view.T_world_camera.IsFinite()) return {};
  history_.AddKeyframe(view);
  // Late masks do not set the up direction, because a correction may have changed it since their frame.
  store_.SetUp(view.up_world);
  if (!current_.usable || view.frame->frame_id != current_.frame_id) return {};
  return ObserveMaskedKeyframe(view);
}

ObjectOutput ObjectMapper::ObserveLateMasks(const FrameMasks& masks) {
  current_ = {};
  auto masked = history_.AddLateMasks(masks);
  if (!masks.instances.empty()) confirmation_.CountMaskedFrame(/*has_pose=*/masked.has_value());
  if (!masked) {
    spdlog::debug("objects: late masks of frame {} ignored", masks.frame_id);
    return {};
  }
  ObjectOutput output = ObserveMaskedFrame(masked->tracked);
  if (!masked->view) masked->view = history_.MakeStandIn(masked->tracked, store_.points());
  if (masked->view) output.Append(ObserveMaskedKeyframe(*masked->view));
  return output;
}

ObjectOutput ObjectMapper::Correct(const MapCorrection& correction) {
  ObjectOutput output;
  for (const MapMerge& merge : correction.merged_maps) store_.MergeMaps(merge, frame_index_);
  store_.MovePoints(correction.points);
  store_.SetUp(correction.up_world);
  KeyframeCorrections keyframes = UsableCorrections(correction);
  history_.Correct(&keyframes);
  scene_depth_.Correct(keyframes);
  std::vector<Landmark*> corrected = store_.DormantLandmarks();
  for (const auto& landmark : store_.landmarks()) corrected.push_back(landmark.get());
  for (Landmark* landmark : corrected) {
    const auto S_new_old = store_.Correct(*landmark, keyframes);
    if (S_new_old) publisher_.Correct(landmark->key, *S_new_old, keyframes);
  }
  for (const auto& landmark : store_.landmarks()) {
    if (publisher_.IsPublished(landmark->key)) publisher_.Publish(*landmark, When::kChanged, store_, &output);
  }
  if (!correction.merged_maps.empty()) MergeDuplicates(&output);
  return output;
}

ObjectOutput ObjectMapper::Finish() {
  ObjectOutput output;
  for (const SparseMapId map : store_.Maps()) {
    store_.SetMap(map, frame_index_);
    FinishMap(&output);
  }
  return output;
}

void ObjectMapper::FinishMap(ObjectOutput* output) {
  const std::vector<LandmarkKey> keys = store_.Keys();
  fitter_.FitAll(frame_index_, publisher_.ConfirmedCuboids(store_), &store_);
  Confirm(keys);
  MergeDuplicates(output);
  ReportConfirmation();
  Prune([](const Landmark& landmark) { return DecidePruningAtFinish(landmark.state); }, output);
  PublishChanges(keys, output);
  for (const auto& landmark : store_.landmarks()) {
    if (publisher_.HasUnpublishedCorrection(landmark->key)) {
      publisher_.Publish(*landmark, When::kAlways, store_, output);
    }
  }
}

void ObjectMapper::ReportConfirmation() {
  for (const auto& landmark : store_.landmarks()) {
    if (landmark->state == ObjectState::kProvisional) {
      confirmation_.AddUnconfirmed(DecideConfirmation(landmark->evidence, landmark->geometry, config_).reason);
    } else {
      confirmation_.AddConfirmed();
    }
  }
}

std::vector<Diagnostic> ObjectMapper::Diagnostics() const {
  const auto diagnostic = confirmation_.Check(config_);
  return diagnostic ? std::vector<Diagnostic>{*diagnostic} : std::vector<Diagnostic>{};
}

ObjectOutput ObjectMapper::ObserveMaskedFrame(const TrackedFrame& tracked) {
  ObjectOutput output;
  current_.usable = true;
  current_.frame_id = tracked.frame->frame_id;
  current_.detections = ExtractDetections(*tracked.frame, config_);
  ++frame_index_;
  RemoveNonObjects(tracked.frame->non_objects, &output);
  const Association association =
      Associate(tracked, current_.detections, store_.landmarks(), frame_index_, scene_depth_.value_mu(), config_);
  UpdateMissed(association, &output);
  RecordObservations(association, tracked, &output);
  store_.CountCoVisibility(current_, association.covered_by);
  PruneFalseLandmarks(&output);
  return output;
}

// Removes the landmarks that were born from masks that turned out to show no object.
void ObjectMapper::RemoveNonObjects(const std::vector<NonObjectMask>& masks, ObjectOutput* output) {
  constexpr double kSameMaskIou = 0.6;  // of its box and that of the landmark's last observation
  constexpr uint64_t kMaxAge = 15;      // frames since that observation
  for (const NonObjectMask& mask : masks) {
    Prune(
        [&](const Landmark& landmark) -> Decision {
          const bool is_same = frame_index_ - landmark.evidence.last_frame <= kMaxAge &&
                               BoxIou(landmark.last_box_px, mask.box_px) > kSameMaskIou &&
                               landmark.evidence.BestClass().first == mask.class_name;
          return {is_same, is_same ? mask.reason : "another mask"};
        },
        output);
  }
}

void ObjectMapper::UpdateMissed(const Association& association, ObjectOutput* output) {
  constexpr double kMinVisibleShare = 0.6;  // of the body, unoccluded in the image: a detection is expected
  const LandmarkStore::Landmarks& landmarks = store_.landmarks();
  std::vector<bool> matched(landmarks.size(), false);
  for (const Match& match : association.matches) {
    if (match.landmark >= 0) matched[static_cast<size_t>(match.landmark)] = true;
  }
  for (size_t l = 0; l < landmarks.size(); ++l) {
    Landmark& landmark = *landmarks[l];
    if (matched[l] || association.visible_share[l] < kMinVisibleShare) continue;
    ++landmark.evidence.expected;
    ++landmark.evidence.missed_in_view;
    const Decision lost = DecideLoss(landmark.state, landmark.evidence, config_);
    if (!lost.yes) continue;
    landmark.state = ObjectState::kLost;
    spdlog::debug("objects: landmark {} is lost: {} in {} frames", landmark.key, lost.reason,
                  landmark.evidence.missed_in_view);
    publisher_.Publish(landmark, When::kAlways, store_, output);
  }
}

void ObjectMapper::RecordObservations(const Association& association, const TrackedFrame& tracked,
                                      ObjectOutput* output) {
  for (size_t d = 0; d < current_.detections.size(); ++d) {
    const Match& match = association.matches[d];
    current_.unambiguous.push_back(match.doubt == nullptr);
    if (match.landmark < 0 && match.doubt != nullptr) {
      current_.keys.push_back(kNoLandmark);
    } else {
      RecordObservation(match, current_.detections[d], tracked, output);
    }
  }
}

void ObjectMapper::RecordObservation(const Match& match, const Detection& detection, const TrackedFrame& tracked,
                                     ObjectOutput* output) {
  const bool is_new = match.landmark < 0;
  Landmark& landmark = is_new ? store_.Create() : *store_.landmarks()[static_cast<size_t>(match.landmark)];
  if (is_new) {
    landmark.evidence.first_frame_id = current_.frame_id;
    spdlog::debug("objects: frame {}: label {} ({}) is a new landmark {}", current_.frame_id, detection.label,
                  detection.class_name, landmark.key);
  }
  current_.keys.push_back(landmark.key);
  LandmarkEvidence& evidence = landmark.evidence;
  if (match.agreement) {
    evidence.agreement_sum += *match.agreement;
    ++evidence.agreement_count;
  }
  evidence.last_frame = frame_index_;
  evidence.dormant_frames = 0;
  evidence.missed_in_view = 0;
  ++evidence.observations;
  ++evidence.expected;
  evidence.class_evidence[detection.class_name] += detection.score;
  landmark.last_box_px = detection.box_px;
  landmark.last_T_world_camera = tracked.T_world_camera;
  landmark.last_track_id = detection.track_id;
  if (landmark.state != ObjectState::kLost) return;
  landmark.state = ObjectState::kConfirmed;
  publisher_.Publish(landmark, When::kAlways, store_, output);
}

void ObjectMapper::PruneFalseLandmarks(ObjectOutput* output) {
  Prune(
      [&](const Landmark& landmark) {
        return DecidePruning(landmark.state, landmark.evidence, landmark.geometry.cuboid.has_value(), frame_index_,
                             config_);
      },
      output);
  for (size_t d = 0; d < current_.keys.size(); ++d) {
    if (store_.Find(current_.keys[d]) != nullptr) continue;
    current_.keys[d] = kNoLandmark;
    current_.unambiguous[d] = false;
  }
}

template <class DecisionFunction>
void ObjectMapper::Prune(const DecisionFunction& decide, ObjectOutput* output) {
  store_.RemoveIf([&](const Landmark& landmark) {
    const Decision pruned = decide(landmark);
    if (!pruned.yes) return false;
    spdlog::debug("objects: landmark {} removed: {} ({} observations, {} expected)", landmark.key, pruned.reason,
                  landmark.evidence.observations, landmark.evidence.expected);
    publisher_.Remove(landmark.key, pruned.reason, output);
    return true;
  });
}

ObjectOutput ObjectMapper::ObserveMaskedKeyframe(const KeyframeView& view) {
  ObjectOutput output;
  store_.CountPointVotes(view, current_);
  scene_depth_.Update(view);
  const ShapeFitter::Cuboids cuboids = publisher_.ConfirmedCuboids(store_);
  fitter_.AddSilhouettes(view, current_, cuboids, &store_);
  publisher_.OfferViews(view, current_);
  const std::vector<LandmarkKey> changed =
      ChangedLandmarks(fitter_.FitMostUrgent(frame_index_, cuboids, &store_), current_);
  Confirm(changed);
  MergeDuplicates(&output);
  PublishChanges(changed, &output);
  return output;
}

void ObjectMapper::Confirm(const std::vector<LandmarkKey>& keys) {
  const LandmarkStore::Landmarks& landmarks = store_.landmarks();
  for (LandmarkKey key : keys) {
    Landmark& landmark = *store_.Find(key);
    if (landmark.state != ObjectState::kProvisional) continue;
    if (!DecideConfirmation(landmark.evidence, landmark.geometry, config_).yes) continue;
    // A duplicate of an object is not confirmed, because it will be merged.
    const bool is_duplicate = std::any_of(landmarks.begin(), landmarks.end(), [&](const auto& other) {
      return other->key != key && other->state != ObjectState::kProvisional &&
             DecideMerge(landmark, *other, store_.points()).yes;
    });
    if (is_duplicate) continue;
    landmark.state = ObjectState::kConfirmed;
    const ObjectId id = publisher_.AssignId(key);
    spdlog::debug("objects: landmark {} confirmed as {} ({}): {} observations, {} points, parallax {:.0f} deg", key,
                  id.ToString(), landmark.evidence.BestClass().first, landmark.evidence.observations,
                  landmark.geometry.points.size(), landmark.geometry.parallax_rad / kRadPerDeg);
  }
}

void ObjectMapper::MergeDuplicates(ObjectOutput* output) {
  const LandmarkStore::Landmarks& landmarks = store_.landmarks();
  for (size_t i = 0; i < landmarks.size(); ++i) {
    for (size_t j = i + 1; j < landmarks.size();) {
      Landmark& first = *landmarks[i];
      Landmark& second = *landmarks[j];
      const Decision merged = DecideMerge(first, second, store_.points());
      if (!merged.yes) {
        ++j;
        continue;
      }
      const bool keep_second = publisher_.MergeRank(second) < publisher_.MergeRank(first);
      spdlog::debug("objects: landmarks {} and {} merged: {}", first.key, second.key, merged.reason);
      keep_second ? Merge(first, second, output) : Merge(second, first, output);
    }
  }
}

void ObjectMapper::Merge(Landmark& from, Landmark& into, ObjectOutput* output) {
  // Landmarks that were detected together are parts of one object, and a part does not show the object's outline.
  const bool from_is_part = CountCoVisibility(from, into).together > 0;
  store_.Merge(from, into, /*adopt_silhouettes=*/!from_is_part);
  std::replace(current_.keys.begin(), current_.keys.end(), from.key, into.key);
  publisher_.Merge(from, into, /*adopt_views=*/!from_is_part, store_, output);
  store_.RemoveMerged(from.key, into.key);
}

void ObjectMapper::PublishChanges(const std::vector<LandmarkKey>& keys, ObjectOutput* output) {
  for (LandmarkKey key : keys) {
    const Landmark* landmark = store_.Find(key);
    if (landmark == nullptr) continue;  // merged into another one
    if (DecideAnnouncement(landmark->evidence, landmark->geometry).yes) publisher_.AssignId(key);
    if (publisher_.HasId(key)) publisher_.Publish(*landmark, When::kChanged, store_, output);
  }
}

}  // namespace romap::objects
