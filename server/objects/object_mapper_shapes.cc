// The part of ObjectMapper that collects what a keyframe shows of the landmarks and gives them boxes.

#include <algorithm>
#include <utility>

#include "server/objects/fit_schedule.h"
#include "server/objects/lines/line_segments.h"
#include "server/objects/object_mapper.h"

namespace romap::objects {

void ObjectMapper::CollectSilhouettes(const KeyframeView& view) {
  if (current_.detections.empty()) return;
  const auto masks = ThinMasks(view.frame->labels, current_.detections, current_.keys);
  const std::map<LandmarkKey, Cuboid> cuboids = PublishedCuboids();
  std::vector<KeptSilhouette> kept;
  for (size_t d = 0; d < current_.detections.size(); ++d) {
    if (!current_.certain[d]) continue;
    const Detection& detection = current_.detections[d];
    Landmark& landmark = *FindLandmark(current_.keys[d]);
    ++landmark.keyframe_sightings;
    landmark.keyframes.push_back(view.id);
    Silhouette silhouette = MakeSilhouette(view, masks, detection, d);
    if (landmark.shape.IsRedundant(silhouette)) continue;
    UpdateNeighbours(cuboids, &silhouette);
    kept.push_back({&landmark, &detection, std::move(silhouette)});
  }
  FindSegments(view, &kept);
  for (KeptSilhouette& entry : kept) {
    entry.landmark->needs_fit |= entry.landmark->shape.AddSilhouette(std::move(entry.silhouette));
  }
}

void ObjectMapper::FindSegments(const KeyframeView& view, std::vector<KeptSilhouette>* kept) const {
  std::vector<KeptSilhouette*> wanting;
  for (KeptSilhouette& entry : *kept) {
    if (entry.landmark->shape.WantsSegments(entry.silhouette)) wanting.push_back(&entry);
  }
  // Edges cost more than all the rest of a silhouette, so only those get them whose landmarks know the fewest.
  const auto rank = [](const KeptSilhouette* entry) {
    return std::pair(entry->landmark->shape.SegmentViews(), entry->landmark->key);
  };
  std::sort(wanting.begin(), wanting.end(), [&](const auto* a, const auto* b) { return rank(a) < rank(b); });
  constexpr size_t most = 1;
  if (wanting.size() > most) wanting.resize(most);
  for (KeptSilhouette* entry : wanting) {
    entry->silhouette.segments =
        FindLineSegments(view.frame->image_bgr, view.frame->labels, entry->detection->label, entry->detection->box_px);
    entry->silhouette.has_segments = true;
  }
}

void ObjectMapper::OfferViews(const KeyframeView& view) {
  std::vector<uint16_t> labels;
  for (const Detection& detection : current_.detections) labels.push_back(detection.label);
  for (size_t d = 0; d < current_.detections.size(); ++d) {
    if (!current_.certain[d]) continue;
    const Detection& detection = current_.detections[d];
    ViewCandidate candidate{.keyframe = view.id,
                            .frame = view.frame,
                            .T_world_camera = view.T_world_camera,
                            .label = detection.label,
                            .box_px = detection.box_px,
                            .points = {},
                            .pixels_px = {},
                            .detected = current_.keys,
                            .detected_labels = labels};
    for (const PointObservation& observation : view.observations) {
      if (observation.label != detection.label) continue;
      candidate.points.push_back(observation.point);
      candidate.pixels_px.push_back(observation.pixel_px);
    }
    FindLandmark(current_.keys[d])->views.Offer(std::move(candidate));
  }
}

std::vector<LandmarkKey> ObjectMapper::FitNeediest() {
  std::vector<FitRequest> requests;
  for (const auto& landmark : landmarks_) {
    // Points alone move a box too little to pay for a fit, unless there is none yet.
    const bool seeks_first_box = !landmark->cuboid && landmark->last_frame == frame_index_;
    if (!landmark->needs_fit && !seeks_first_box) continue;
    const FitRequest request{.key = landmark->key,
                             .confirmed = landmark->state != ObjectState::kProvisional,
                             .silhouettes = static_cast<int>(landmark->shape.silhouettes().size()),
                             .news = landmark->shape.news(),
                             .waiting_frames = frame_index_ - landmark->last_fit_frame};
    if (IsWorthAFit(request)) requests.push_back(request);
  }
  return FitShapes(OrderByNeed(requests), static_cast<size_t>(config_.cuboid_fits_per_keyframe));
}

void ObjectMapper::FitAll() {
  std::vector<LandmarkKey> keys;
  for (const auto& landmark : landmarks_) {
    if (landmark->needs_fit || !landmark->cuboid) keys.push_back(landmark->key);
  }
  FitShapes(keys, keys.size());
}

std::vector<LandmarkKey> ObjectMapper::FitShapes(const std::vector<LandmarkKey>& keys, size_t most) {
  std::vector<LandmarkKey> fitted;
  if (keys.empty()) return fitted;
  const PointGroups groups = registry_.GroupByOwner();
  std::vector<Eigen::Vector3d> background;
  const auto found = groups.find(kBackgroundKey);
  if (found != groups.end()) {
    for (const PointRegistry::Member& member : found->second) background.push_back(member.position_world);
  }
  for (LandmarkKey key : keys) {
    if (fitted.size() >= most) break;
    if (FitShape(*FindLandmark(key), groups, background)) fitted.push_back(key);
  }
  return fitted;
}

std::map<LandmarkKey, Cuboid> ObjectMapper::PublishedCuboids() const {
  std::map<LandmarkKey, Cuboid> cuboids;
  for (const auto& landmark : landmarks_) {
    if (landmark->IsConfirmed()) cuboids[landmark->key] = landmark->published->cuboid;
  }
  return cuboids;
}

bool ObjectMapper::FitShape(Landmark& landmark, const PointGroups& groups,
                            const std::vector<Eigen::Vector3d>& background) {
  if (landmark.shape.silhouettes().empty()) return false;
  std::vector<MapPointId> ids;
  std::vector<Eigen::Vector3d> positions;
  const auto members = groups.find(landmark.key);
  if (members != groups.end()) {
    for (const PointRegistry::Member& member : members->second) {
      ids.push_back(member.id);
      positions.push_back(member.position_world);
    }
  }
  std::map<LandmarkKey, Cuboid> neighbours = PublishedCuboids();
  neighbours.erase(landmark.key);
  const auto fit = landmark.shape.Update(
      {.up_world = up_world_, .points = positions, .background = background, .neighbours = &neighbours},
      landmark.cuboid);
  landmark.needs_fit = false;
  landmark.last_fit_frame = frame_index_;
  if (!fit) {
    if (!landmark.cuboid) landmark.body_world = positions;
    return false;
  }
  landmark.cuboid = Upright(fit->cuboid, up_world_);
  landmark.reach = Upright(fit->reach, up_world_);
  landmark.body_world = fit->body_world;
  landmark.parallax_rad = fit->parallax_rad;
  landmark.points.clear();
  for (size_t i = 0; i < ids.size(); ++i) {
    if (fit->point_is_inlier[i]) landmark.points.push_back(ids[i]);
  }
  return true;
}

}  // namespace romap::objects
