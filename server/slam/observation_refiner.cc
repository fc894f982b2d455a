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

namespace romap::slam {
namespace {

constexpr size_t kStoredImages = 24;
// Two images of one surface patch correlate by more than 0.8 unless it is at a depth edge or the light moved; images of
// different patches rarely by more than 0.5.
constexpr double kMinCorrelation = 0.7;
constexpr double kWrongCorrelation = 0.3;
constexpr double kMinAddedCorrelation = 0.85;  // of a point that no descriptor confirms
constexpr size_t kRefinedNeighbors = 10;       // keyframes whose points are searched
constexpr size_t kMaxAdded = 600;              // observations per keyframe, to limit the time of bundle adjustment
constexpr double kMinViewCosine = 0.87;        // 30 degrees between the reference's ray and the new one
constexpr double kMinOctaveScale = 0.7;

// Derivative of pixels in `keyframe` by pixels in `reference` for a surface through the point that faces the reference
// camera; nullopt if the point is behind a camera.
std::optional<Eigen::Matrix2d> PixelsByReferencePixels(const CameraModel& camera,
                                                       const SE3<Camera, World>& T_camera_world,
                                                       const SE3<World, Camera>& T_world_reference,
                                                       const Eigen::Vector3d& p_world) {
  const Eigen::Vector3d p_reference = T_world_reference.Inverse() * p_world;
  const Eigen::Vector3d p_camera = T_camera_world * p_world;
  if (!(p_reference.z() > 0) || !(p_camera.z() > 0)) return std::nullopt;
  // The plane through the point, perpendicular to its ray: moving by one pixel along the image moves the point on it.
  const Eigen::Vector3d normal = p_reference.normalized();
  Eigen::Matrix<double, 3, 2> step;
  for (int axis = 0; axis < 2; ++axis) {
    Eigen::Vector3d ray_step = Eigen::Vector3d::Zero();
    ray_step[axis] = p_reference.z() / (axis == 0 ? camera.fx_px : camera.fy_px);
    // Along the ray, back onto the plane.
    step.col(axis) = ray_step - p_reference * (normal.dot(ray_step) / normal.dot(p_reference));
  }
  const Eigen::Matrix3d R_camera_reference =
      T_camera_world.rotation().toRotationMatrix() * T_world_reference.rotation().toRotationMatrix();
  const double inverse_z = 1 / p_camera.z();
  Eigen::Matrix<double, 2, 3> projection;
  projection << camera.fx_px * inverse_z, 0, -camera.fx_px * p_camera.x() * inverse_z * inverse_z,  //
      0, camera.fy_px * inverse_z, -camera.fy_px * p_camera.y() * inverse_z * inverse_z;
  return projection * (R_camera_reference * step);
}

}  // namespace

void ObservationRefiner::Refine(const Frame& frame, bool search_points, MapKeyframe& keyframe, SlamMap& map) {
  images_[keyframe.id] = HalvedImages(frame.image_bgr);
  if (images_.size() > kStoredImages) images_.erase(images_.begin());
  for (size_t i = 0; i < keyframe.points.size(); ++i) {
    if (!keyframe.points[i]) continue;
    PointTrack& track = *map.FindPoint(keyframe.points[i]);
    if (track.patch) {
      Align(track, {keyframe.id, static_cast<int>(i)}, map);
      continue;
    }
    const auto patch = Patch::Read(images_.at(keyframe.id), keyframe.frame->image_px[i].cast<double>(),
                                   keyframe.features()[i].octave_scale);
    if (!patch) continue;
    track.patch = std::make_shared<const ReferencePatch>(
        ReferencePatch{.patch = *patch, .keyframe = keyframe.id, .octave_scale = keyframe.features()[i].octave_scale});
    for (const FeatureRef& observation : track.observations) {
      if (observation.keyframe != keyframe.id) Align(track, observation, map);
    }
  }
  Apply(map);
  if (search_points) AddObservations(frame, keyframe, map);
}

// Finds points by their patches where the detector found no corner, or one with another descriptor.
void ObservationRefiner::AddObservations(const Frame& frame, MapKeyframe& keyframe, SlamMap& map) {
  const HalvedImages& image = images_.at(keyframe.id);
  std::vector<Feature> features = UncorrectedFeatures(*keyframe.frame);
  std::vector<MapPointId> found;
  for (const MapPointId id : PointsOf(map, Neighborhood(map, keyframe, kRefinedNeighbors, 0))) {
    const PointTrack& track = *map.FindPoint(id);
    if (!track.patch || track.IsObservedBy(keyframe.id)) continue;
    const std::optional<FoundPatch> patch = FindPatch(track, keyframe, image, map);
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
  keyframe.frame = MakeFrameFeatures(frame, std::move(features), keyframe.frame->lens);
  keyframe.points.resize(keyframe.frame->size());
  for (size_t i = 0; i < found.size(); ++i) {
    map.AddObservation(*map.FindPoint(found[i]), keyframe, first + static_cast<int>(i));
  }
}

std::optional<ObservationRefiner::FoundPatch> ObservationRefiner::FindPatch(const PointTrack& track,
                                                                            const MapKeyframe& keyframe,
                                                                            const HalvedImages& image,
                                                                            const SlamMap& map) const {
  const MapKeyframe* reference = map.FindKeyframe(track.patch->keyframe);
  if (reference == nullptr) return std::nullopt;
  const Eigen::Vector3d& p_world = track.point.position_world;
  const Eigen::Vector3d ray = p_world - keyframe.center_world();
  const Eigen::Vector3d reference_ray = p_world - reference->center_world();
  if (ray.dot(reference_ray) < kMinViewCosine * ray.norm() * reference_ray.norm()) return std::nullopt;
  const Eigen::Vector3d p_camera = keyframe.T_camera_world() * p_world;
  if (!(p_camera.z() > 0)) return std::nullopt;
  const Eigen::Vector2d image_px = keyframe.frame->lens.Distort(keyframe.camera(), keyframe.camera().Project(p_camera));
  const auto by_reference_pixels =
      PixelsByReferencePixels(keyframe.camera(), keyframe.T_camera_world(), reference->T_world_camera(), p_world);
  if (!by_reference_pixels) return std::nullopt;
  const double octave_scale = track.patch->octave_scale * std::sqrt(std::abs(by_reference_pixels->determinant()));
  if (octave_scale < kMinOctaveScale || octave_scale > 1.2 * kMaxOctaveScale) return std::nullopt;
  const auto aligned =
      AlignPatch(track.patch->patch, image, track.patch->octave_scale * *by_reference_pixels, image_px);
  if (!aligned || aligned->correlation < kMinAddedCorrelation) return std::nullopt;
  return FoundPatch{aligned->pixel_px, octave_scale};
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
