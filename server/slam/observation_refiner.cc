#include "server/slam/observation_refiner.h"

#include <spdlog/spdlog.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "common/label_image.h"
#include "server/slam/covisibility.h"
#include "server/slam/patch_search.h"

namespace romap::slam {
namespace {

constexpr size_t kStoredImages = 24;
// Two images of one surface patch correlate by more than 0.8 unless it is at a depth edge or the light moved; images of
// different patches rarely by more than 0.5.
constexpr double kMinCorrelation = 0.7;
constexpr double kWrongCorrelation = 0.3;
constexpr size_t kRefinedNeighbors = 10;  // keyframes whose points are searched
constexpr size_t kMaxAdded = 600;         // observations per keyframe, to limit the time of bundle adjustment

}  // namespace

void ObservationRefiner::ReadPatches(const Frame& frame, const MapKeyframe& keyframe, SlamMap& map) {
  const HalvedImages image = images_.try_emplace(keyframe.id, frame.image_bgr).first->second;  // may be erased below
  if (images_.size() > kStoredImages) images_.erase(images_.begin());
  for (size_t i = 0; i < keyframe.points.size(); ++i) {
    if (!keyframe.points[i]) continue;
    PointTrack& track = *map.FindPoint(keyframe.points[i]);
    if (track.patch) continue;
    const double octave_scale = keyframe.features()[i].octave_scale;
    const auto patch = Patch::Read(image, keyframe.frame->image_px[i].cast<double>(), octave_scale);
    if (!patch) continue;
    track.patch = std::make_shared<const ReferencePatch>(
        ReferencePatch{.patch = *patch, .keyframe = keyframe.id, .octave_scale = octave_scale});
  }
}

void ObservationRefiner::Refine(const Frame& frame, MapKeyframe& keyframe, SlamMap& map) {
  ReadPatches(frame, keyframe, map);
  for (size_t i = 0; i < keyframe.points.size(); ++i) {
    if (!keyframe.points[i]) continue;
    const PointTrack& track = *map.FindPoint(keyframe.points[i]);
    if (!track.patch) continue;
    if (track.patch->keyframe != keyframe.id) {
      Align(track, {keyframe.id, static_cast<int>(i)}, map);
      continue;
    }
    for (const FeatureRef& observation : track.observations) {
      if (observation.keyframe != keyframe.id) Align(track, observation, map);
    }
  }
  Apply(map);
}

// The detector found no corner there, or one with another descriptor.
void ObservationRefiner::Search(const Frame& frame, MapKeyframe& keyframe, SlamMap& map) {
  const auto stored = images_.find(keyframe.id);
  const HalvedImages image = stored == images_.end() ? HalvedImages(frame.image_bgr) : stored->second;
  const PatchTarget target{.camera = keyframe.camera(),
                           .lens = keyframe.frame->lens,
                           .image = image,
                           .T_camera_world = keyframe.T_camera_world(),
                           .center_world = keyframe.center_world(),
                           .shutter = keyframe.frame->shutter.get(),
                           .is_converted = true};
  std::vector<Feature> features = UncorrectedFeatures(*keyframe.frame);
  std::vector<MapPointId> found;
  for (const MapPointId id : PointsOf(map, Neighborhood(map, keyframe, kRefinedNeighbors, 0))) {
    const PointTrack& track = *map.FindPoint(id);
    if (!track.patch || track.IsObservedBy(keyframe.id)) continue;
    const MapKeyframe* reference = map.FindKeyframe(track.patch->keyframe);
    if (reference == nullptr) continue;
    const std::optional<FoundPatch> patch =
        FindPatch(*track.patch, reference->T_world_camera(), track.point.position_world, target);
    if (!patch) continue;
    Feature feature{.pixel_px = patch->image_px.cast<float>(), .descriptor = track.descriptor};
    feature.octave = std::clamp(static_cast<int>(std::lround(std::log(patch->octave_scale) / std::log(kOctaveFactor))),
                                0, kOctaves - 1);
    feature.octave_scale = std::pow(kOctaveFactor, feature.octave);
    feature.label =
        LabelAt(frame.labels, feature.pixel_px, static_cast<int>(std::lround(mask_erosion_px_ * feature.octave_scale)));
    features.push_back(feature);
    found.push_back(id);
    if (found.size() == kMaxAdded) break;
  }
  counts_.added += static_cast<int>(found.size());
  spdlog::debug("slam: observations so far: {} aligned, {} not aligned, {} removed, {} added", counts_.aligned,
                counts_.not_aligned, counts_.removed, counts_.added);
  if (found.empty()) return;
  const auto first = static_cast<int>(keyframe.points.size());
  keyframe.frame = MakeFrameFeatures(frame, std::move(features), keyframe.frame->lens, keyframe.frame->shutter);
  keyframe.points.resize(keyframe.frame->size());
  for (size_t i = 0; i < found.size(); ++i) {
    map.AddObservation(*map.FindPoint(found[i]), keyframe, first + static_cast<int>(i));
  }
}

void ObservationRefiner::Align(const PointTrack& track, const FeatureRef& observation, SlamMap& map) {
  const auto image = images_.find(observation.keyframe);
  const MapKeyframe* reference = map.FindKeyframe(track.patch->keyframe);
  if (image == images_.end() || reference == nullptr) return;
  const MapKeyframe& keyframe = *map.FindKeyframe(observation.keyframe);
  const auto by_reference_pixels = PixelsByReferencePixels(keyframe.camera(), keyframe.T_camera_world(),
                                                           reference->T_world_camera(), track.point.position_world);
  if (!by_reference_pixels) return;
  const Eigen::Vector2d start_px = keyframe.frame->image_px[static_cast<size_t>(observation.feature)].cast<double>();
  const auto aligned =
      AlignPatch(track.patch->patch, image->second, track.patch->octave_scale * *by_reference_pixels, start_px);
  if (aligned && aligned->correlation >= kMinCorrelation) {
    moved_[keyframe.id].push_back({observation.feature, aligned->pixel_px});
    ++counts_.aligned;
  } else if (aligned && aligned->correlation < kWrongCorrelation) {
    wrong_.emplace_back(track.point.id, keyframe.id);
    ++counts_.removed;
  } else {
    ++counts_.not_aligned;
  }
}

void ObservationRefiner::Apply(SlamMap& map) {
  for (auto& [id, pixels] : moved_) {
    MapKeyframe& keyframe = *map.FindKeyframe(id);
    std::vector<Eigen::Vector2f> image_px = keyframe.frame->image_px;
    for (const NewPixel& pixel : pixels) image_px[static_cast<size_t>(pixel.feature)] = pixel.image_px.cast<float>();
    keyframe.frame = WithImagePixels(*keyframe.frame, std::move(image_px));
  }
  for (const auto& [point, keyframe] : wrong_) map.RemoveObservation(point, keyframe);
  moved_.clear();
  wrong_.clear();
}

}  // namespace romap::slam
