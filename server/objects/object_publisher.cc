#include "server/objects/object_publisher.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "common/angles.h"
#include "common/map_motion.h"

namespace romap::objects {
namespace {

// Whether a new fit differs enough from a cuboid to be published.
bool DiffersNoticeably(const Cuboid& a, const Cuboid& b) {
  constexpr double kChangeShare = 0.02;  // of the longest side, by which the center or a side changed
  constexpr double kTurnRad = 2 * kRadPerDeg;
  const double size = 2 * a.half_extents.maxCoeff();
  const double shift = (a.T_world_object.translation() - b.T_world_object.translation()).norm();
  const double growth = 2 * (a.half_extents - b.half_extents).cwiseAbs().maxCoeff();
  const double turn_rad = a.T_world_object.rotation().angularDistance(b.T_world_object.rotation());
  return std::max(shift, growth) > kChangeShare * size || turn_rad > kTurnRad;
}

// Whether corrections moved the published cuboid enough to publish it again. `S_now_published` is tested as well,
// because it may rotate meshes while the upright cuboid does not change.
bool MovedNoticeably(const Cuboid& published, const Cuboid& now, const Sim3<World, World>& S_now_published) {
  constexpr double kShiftShare = 0.005;  // of the cuboid's longest side
  constexpr double kScaleShare = 0.002;  // change of scale
  constexpr double kTurnRad = 0.2 * kRadPerDeg;
  const double size = 2 * published.half_extents.maxCoeff();
  const double shift = (now.T_world_object.translation() - published.T_world_object.translation()).norm();
  const double turn_rad = std::max(now.T_world_object.rotation().angularDistance(published.T_world_object.rotation()),
                                   S_now_published.rotation().angularDistance(Eigen::Quaterniond::Identity()));
  return shift > kShiftShare * size || turn_rad > kTurnRad || std::abs(std::log(S_now_published.scale())) > kScaleShare;
}

}  // namespace

// Differences between a landmark and its published state.
struct ObjectPublisher::Change {
  bool cuboid = false;  // a new fit, or nothing was published before
  bool moved = false;   // by corrections
  bool text = false;    // class, state or map
  Cuboid newest;        // the cuboid to publish

  bool Any() const { return cuboid || moved || text; }
};

ObjectPublisher::Publication& ObjectPublisher::PublicationOf(LandmarkKey key) {
  return publications_.try_emplace(key, config_).first->second;
}

const ObjectPublisher::Publication* ObjectPublisher::Find(LandmarkKey key) const {
  const auto found = publications_.find(key);
  return found == publications_.end() ? nullptr : &found->second;
}

ObjectId ObjectPublisher::AssignId(LandmarkKey key) {
  Publication& publication = PublicationOf(key);
  if (!publication.id) publication.id = ObjectId{++last_id_};
  return publication.id;
}

bool ObjectPublisher::HasId(LandmarkKey key) const {
  const Publication* publication = Find(key);
  return publication != nullptr && publication->id;
}

bool ObjectPublisher::IsPublished(LandmarkKey key) const {
  const Publication* publication = Find(key);
  return publication != nullptr && publication->last;
}

bool ObjectPublisher::HasUnpublishedCorrection(LandmarkKey key) const {
  return IsPublished(key) && Find(key)->S_now_published;
}

std::tuple<bool, bool, ObjectId> ObjectPublisher::MergeRank(const Landmark& landmark) const {
  const Publication* publication = Find(landmark.key);
  const ObjectId id = publication == nullptr ? ObjectId{} : publication->id;
  return {landmark.state == ObjectState::kProvisional, !id, id};
}

bool ObjectPublisher::IsConfirmed(const Landmark& landmark) const {
  return landmark.state != ObjectState::kProvisional && IsPublished(landmark.key);
}

std::map<LandmarkKey, Cuboid> ObjectPublisher::ConfirmedCuboids(const LandmarkStore& store) const {
  std::map<LandmarkKey, Cuboid> cuboids;
  for (const auto& landmark : store.landmarks()) {
    if (IsConfirmed(*landmark)) cuboids[landmark->key] = Find(landmark->key)->last->cuboid;
  }
  return cuboids;
}

void ObjectPublisher::OfferViews(const KeyframeView& view, const FrameDetections& frame) {
  std::vector<uint16_t> labels;
  for (const Detection& detection : frame.detections) labels.push_back(detection.label);
  for (size_t d = 0; d < frame.detections.size(); ++d) {
    if (!frame.unambiguous[d]) continue;
    const Detection& detection = frame.detections[d];
    ViewCandidate candidate{.keyframe = view.id,
                            .frame = view.frame,
                            .T_world_camera = view.T_world_camera,
                            .label = detection.label,
                            .box_px = detection.box_px,
                            .points = {},
                            .pixels_px = {},
                            .detected = frame.keys,
                            .detected_labels = labels};
    for (const PointObservation& observation : view.observations) {
      if (observation.label != detection.label) continue;
      candidate.points.push_back(observation.point);
      candidate.pixels_px.push_back(observation.pixel_px);
    }
    PublicationOf(frame.keys[d]).views.Offer(std::move(candidate));
  }
}

void ObjectPublisher::Correct(LandmarkKey key, const Sim3<World, World>& S_new_old,
                              const KeyframeCorrections& keyframes) {
  const auto found = publications_.find(key);
  if (found == publications_.end()) return;
  Publication& publication = found->second;
  publication.S_now_published = S_new_old * publication.S_now_published.value_or(Sim3<World, World>());
  publication.views.Correct(S_new_old, keyframes);
}

std::vector<ObjectView> ObjectPublisher::PickViews(const Landmark& landmark, const LandmarkStore& store,
                                                   Publication* publication) {
  std::vector<ViewContext::Neighbor> neighbors;
  for (const auto& other : store.landmarks()) {
    if (other->key != landmark.key && IsConfirmed(*other)) {
      neighbors.push_back({other->key, Find(other->key)->last->cuboid});
    }
  }
  return publication->views.Take({.object = publication->id,
                                  .cuboid = *landmark.geometry.training_box,
                                  .body_world = landmark.geometry.body_world,
                                  .object_points = landmark.geometry.points,
                                  .registry = &store.points(),
                                  .neighbors = neighbors});
}

ObjectPublisher::Change ObjectPublisher::ChangeOf(const Landmark& landmark, const Eigen::Vector3d& up_world,
                                                  const Publication& publication) {
  const Cuboid& fitted = *landmark.geometry.cuboid;
  if (!publication.last) return {.cuboid = true, .text = true, .newest = fitted};
  const Sim3<World, World> S_now_published = publication.S_now_published.value_or(Sim3<World, World>());
  const Cuboid published_now = Upright(Moved(S_now_published, publication.last->cuboid), up_world);
  Change change;
  change.cuboid = DiffersNoticeably(published_now, fitted);
  change.moved = MovedNoticeably(publication.last->cuboid, published_now, S_now_published);
  change.text = publication.last->class_name != landmark.evidence.BestClass().first ||
                publication.last->state != landmark.state || publication.last->map_id != landmark.map;
  change.newest = change.cuboid ? fitted : published_now;
  return change;
}

void ObjectPublisher::Publish(const Landmark& landmark, When when, const LandmarkStore& store, ObjectOutput* output) {
  if (!landmark.geometry.cuboid) return;
  Publication& publication = PublicationOf(landmark.key);
  if (!publication.last) publication.S_now_published.reset();  // the first published data are in the corrected world
  const Change change = ChangeOf(landmark, store.up_world(), publication);
  const bool is_provisional = landmark.state == ObjectState::kProvisional;
  const Cuboid& training_box = *landmark.geometry.training_box;
  ObjectViews views{.object = publication.id, .cuboid = training_box};
  if (!is_provisional) {
    views.new_views = PickViews(landmark, store, &publication);
    views.corrected_views = publication.views.TakeCorrectedPoses(training_box);
  }
  const bool views_changed = !views.new_views.empty() || !views.corrected_views.empty();
  const bool update = when == When::kAlways || change.Any();
  if (!update && !views_changed) return;
  // Clients and field must move to the corrected world before they receive data in it.
  views.S_new_old = std::exchange(publication.S_now_published, std::nullopt);
  if (!publication.has_field) views.S_new_old.reset();
  if (update || views.S_new_old) {
    const auto [class_name, class_score] = landmark.evidence.BestClass();
    publication.last = ObjectUpdate{.id = publication.id,
                                    .state = landmark.state,
                                    .class_name = class_name,
                                    .class_score = class_score,
                                    .cuboid = change.newest,
                                    .observations = landmark.evidence.observations,
                                    .T_world_mesh = {},
                                    .map_id = landmark.map};
    output->events.emplace_back(*publication.last);
  }
  if (is_provisional) return;  // training starts when the object is confirmed
  if (!publication.has_field || change.cuboid || change.moved || views_changed || views.S_new_old) {
    publication.has_field = true;
    output->views.push_back(std::move(views));
  }
}

void ObjectPublisher::Merge(const Landmark& from, const Landmark& into, bool adopt_views, const LandmarkStore& store,
                            ObjectOutput* output) {
  for (auto& [key, publication] : publications_) publication.views.RenameNeighbor(from.key, into.key);
  Publication& source = PublicationOf(from.key);
  Publication& target = PublicationOf(into.key);
  std::vector<ObjectView> adopted;
  if (adopt_views) {
    const auto& cuboid = into.geometry.cuboid;
    const Eigen::Vector3d center = cuboid ? cuboid->T_world_object.translation() : Eigen::Vector3d(0, 0, 0);
    adopted = target.views.Adopt(std::move(source.views), target.id, center);
  }
  if (source.last) {
    // An object must be published before another one is merged into it.
    if (!target.last) Publish(into, When::kAlways, store, output);
    output->events.emplace_back(ObjectMerged{.from = source.id, .into = target.id});
    Publish(into, When::kAlways, store, output);
    if (!adopted.empty()) {
      output->views.push_back({.object = target.id, .cuboid = *into.geometry.training_box, .new_views = adopted});
    }
  }
  publications_.erase(from.key);
}

void ObjectPublisher::Remove(LandmarkKey key, const char* reason, ObjectOutput* output) {
  const Publication* publication = Find(key);
  if (publication == nullptr) return;
  if (publication->last) output->events.emplace_back(ObjectRemoved{.id = publication->id, .reason = reason});
  publications_.erase(key);
}

}  // namespace romap::objects
