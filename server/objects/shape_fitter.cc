#include "server/objects/shape_fitter.h"

#include <algorithm>
#include <utility>

#include "server/objects/fit_schedule.h"
#include "server/objects/lines/line_segments.h"

namespace romap::objects {
namespace {

// Fits landmarks of one store at one frame, all with the same points and neighbors.
class FitPass {
 public:
  FitPass(uint64_t frame_index, const ShapeFitter::Cuboids& cuboids, LandmarkStore* store)
      : frame_index_(frame_index), cuboids_(cuboids), store_(*store), groups_(store->points().GroupByOwner()) {
    const auto background = groups_.find(kBackgroundKey);
    if (background == groups_.end()) return;
    for (const PointRegistry::Member& member : background->second) background_.push_back(member.position_world);
  }

  // Fits the landmarks in this order until `max_fits` cuboids were found. Returns the keys of the fitted landmarks.
  std::vector<LandmarkKey> Fit(const std::vector<LandmarkKey>& keys, size_t max_fits) const {
    std::vector<LandmarkKey> fitted;
    for (LandmarkKey key : keys) {
      if (fitted.size() >= max_fits) break;
      if (FitLandmark(*store_.Find(key))) fitted.push_back(key);
    }
    return fitted;
  }

 private:
  // Returns false when the evidence does not suffice for a cuboid.
  bool FitLandmark(Landmark& landmark) const {
    if (landmark.shape.silhouettes().empty()) return false;
    std::vector<MapPointId> ids;
    std::vector<Eigen::Vector3d> positions;
    const auto members = groups_.find(landmark.key);
    if (members != groups_.end()) {
      for (const PointRegistry::Member& member : members->second) {
        ids.push_back(member.id);
        positions.push_back(member.position_world);
      }
    }
    ShapeFitter::Cuboids neighbors = cuboids_;
    neighbors.erase(landmark.key);
    LandmarkGeometry& geometry = landmark.geometry;
    const auto fit = landmark.shape.Update(
        {.up_world = store_.up_world(), .points = positions, .background = background_, .neighbors = &neighbors},
        geometry.cuboid);
    landmark.needs_fit = false;
    landmark.last_fit_frame = frame_index_;
    if (!fit) {
      if (!geometry.cuboid) geometry.body_world = positions;
      return false;
    }
    geometry.cuboid = Upright(fit->cuboid, store_.up_world());
    geometry.training_box = Upright(fit->training_box, store_.up_world());
    geometry.body_world = fit->body_world;
    geometry.parallax_rad = fit->parallax_rad;
    geometry.points.clear();
    for (size_t i = 0; i < ids.size(); ++i) {
      if (fit->point_is_inlier[i]) geometry.points.push_back(ids[i]);
    }
    return true;
  }

  uint64_t frame_index_;
  const ShapeFitter::Cuboids& cuboids_;
  LandmarkStore& store_;
  std::map<LandmarkKey, std::vector<PointRegistry::Member>> groups_;
  std::vector<Eigen::Vector3d> background_;
};

}  // namespace

void ShapeFitter::AddSilhouettes(const KeyframeView& view, const FrameDetections& frame, const Cuboids& cuboids,
                                 LandmarkStore* store) const {
  if (frame.detections.empty()) return;
  const auto masks = SubsampleMasks(view.frame->labels, frame.detections, frame.keys);
  std::vector<NewSilhouette> added;
  for (size_t d = 0; d < frame.detections.size(); ++d) {
    if (!frame.unambiguous[d]) continue;
    const Detection& detection = frame.detections[d];
    Landmark& landmark = *store->Find(frame.keys[d]);
    ++landmark.evidence.keyframe_observations;
    if (!detection.CutByBorder()) ++landmark.evidence.whole_observations;
    landmark.keyframes.push_back(view.id);
    Silhouette silhouette = MakeSilhouette(view, masks, detection, d);
    if (landmark.shape.IsRedundant(silhouette)) continue;
    UpdateNeighbors(cuboids, &silhouette);
    added.push_back({&landmark, &detection, std::move(silhouette)});
  }
  FindSegments(view, &added);
  for (NewSilhouette& entry : added) {
    entry.landmark->needs_fit |= entry.landmark->shape.AddSilhouette(std::move(entry.silhouette));
  }
}

void ShapeFitter::FindSegments(const KeyframeView& view, std::vector<NewSilhouette>* silhouettes) {
  std::vector<NewSilhouette*> candidates;
  for (NewSilhouette& entry : *silhouettes) {
    if (entry.landmark->shape.NeedsSegments(entry.silhouette)) candidates.push_back(&entry);
  }
  // Edge detection costs more than the other work on a silhouette, so it runs only for the landmarks with the fewest
  // searched silhouettes.
  const auto rank = [](const NewSilhouette* entry) {
    return std::pair(entry->landmark->shape.SegmentViews(), entry->landmark->key);
  };
  std::sort(candidates.begin(), candidates.end(), [&](const auto* a, const auto* b) { return rank(a) < rank(b); });
  constexpr size_t kMaxSearches = 1;  // per keyframe
  for (size_t i = 0; i < std::min(kMaxSearches, candidates.size()); ++i) {
    const Detection& detection = *candidates[i]->detection;
    Silhouette& silhouette = candidates[i]->silhouette;
    silhouette.segments =
        FindLineSegments(view.frame->image_bgr, view.frame->labels, detection.label, detection.box_px);
    silhouette.has_segments = true;
  }
}

std::vector<LandmarkKey> ShapeFitter::FitMostUrgent(uint64_t frame_index, const Cuboids& cuboids,
                                                    LandmarkStore* store) const {
  std::vector<FitRequest> requests;
  for (const auto& landmark : store->landmarks()) {
    // New points alone change a cuboid too little for a fit, unless there is no cuboid yet.
    const bool needs_first_fit = !landmark->geometry.cuboid && landmark->evidence.last_frame == frame_index;
    if (!landmark->needs_fit && !needs_first_fit) continue;
    const FitRequest request{.key = landmark->key,
                             .confirmed = landmark->state != ObjectState::kProvisional,
                             .silhouettes = static_cast<int>(landmark->shape.silhouettes().size()),
                             .changed = landmark->shape.changed_silhouettes(),
                             .waiting_frames = frame_index - landmark->last_fit_frame};
    if (IsDueForFit(request)) requests.push_back(request);
  }
  if (requests.empty()) return {};
  return FitPass(frame_index, cuboids, store)
      .Fit(OrderByUrgency(requests), static_cast<size_t>(config_.cuboid_fits_per_keyframe));
}

void ShapeFitter::FitAll(uint64_t frame_index, const Cuboids& cuboids, LandmarkStore* store) const {
  std::vector<LandmarkKey> keys;
  for (const auto& landmark : store->landmarks()) {
    if (landmark->needs_fit || !landmark->geometry.cuboid) keys.push_back(landmark->key);
  }
  if (!keys.empty()) FitPass(frame_index, cuboids, store).Fit(keys, keys.size());
}

}  // namespace romap::objects
