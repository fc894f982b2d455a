#include "server/slam/map_adjustment.h"

#include <algorithm>
#include <map>
#include <set>
#include <unordered_map>
#include <utility>

namespace romap::slam {
namespace {

constexpr size_t kMaxAnchorKeyframes = 20;

class ProblemBuilder {
 public:
  ProblemBuilder(const SlamMap& map, const SlamConfig& config, const CameraModel& camera) : map_(map), config_(config) {
    problem_.bundle.camera = camera;
    problem_.newest_keyframe = KeyframeId{map.keyframe_count()};
    problem_.newest_point = MapPointId{map.point_count()};
  }

  // The observations become pixels of the image, before the lens correction. Call it before AddPoint.
  void FindLens() { problem_.bundle.lens = BundleLens{.correction = map_.lens()}; }

  void AddKeyframe(const MapKeyframe& keyframe, bool fixed) {
    camera_of_[keyframe.id] = static_cast<int>(problem_.keyframes.size());
    problem_.keyframes.push_back(keyframe.id);
    problem_.before.push_back(keyframe.T_world_camera());
    problem_.bundle.cameras.push_back(
        {.T_world_camera = keyframe.T_world_camera(), .fixed = fixed || keyframe.pose_given, .prior = keyframe.prior});
  }

  // Adds the point with its observations from keyframes that were added.
  void AddPoint(const PointTrack& track) {
    const auto point = static_cast<int>(problem_.points.size());
    bool is_observed = false;
    for (const FeatureRef& observation : track.observations) {
      const auto camera = camera_of_.find(observation.keyframe);
      if (camera == camera_of_.end()) continue;
      problem_.bundle.observations.push_back(MakeObservation(camera->second, point, observation));
      is_observed = true;
    }
    if (!is_observed) return;
    problem_.points.push_back(track.point.id);
    problem_.bundle.points.push_back({.position_world = track.point.position_world});
  }

  MapProblem Take() { return std::move(problem_); }

 private:
  BundleObservation MakeObservation(int camera, int point, const FeatureRef& ref) const {
    const FrameFeatures& frame = *map_.FindKeyframe(ref.keyframe)->frame;
    const auto i = static_cast<size_t>(ref.feature);
    Eigen::Vector2d pixel_px = frame.features[i].pixel_px.cast<double>();
    if (problem_.bundle.lens) {
      pixel_px = frame.shutter ? frame.lens.Distort(frame.camera, pixel_px) : frame.image_px[i].cast<double>();
    }
    BundleObservation observation{.camera = camera,
                                  .point = point,
                                  .pixel_px = pixel_px,
                                  .sigma_px = config_.pixel_sigma_px * frame.features[i].octave_scale};
    if (frame.ranges_mu[i] > 0) {
      observation.depth_mu = frame.ranges_mu[i] * frame.bearings_camera[i].z();
      observation.depth_sigma_mu = config_.depth_sigma_ratio * observation.depth_mu;
    }
    return observation;
  }

  const SlamMap& map_;
  const SlamConfig& config_;
  MapProblem problem_;
  std::unordered_map<KeyframeId, int> camera_of_;
};

}  // namespace

MapProblem WindowProblem(const SlamMap& map, const MapKeyframe& newest, const SlamConfig& config) {
  std::vector<const MapKeyframe*> window = {&newest};
  for (const auto& [id, shared] : map.Covisible(newest, kMinSharedPoints)) {
    if (window.size() == static_cast<size_t>(config.window_keyframes)) break;
    window.push_back(map.FindKeyframe(id));
  }
  std::set<MapPointId> points;
  for (const MapKeyframe* keyframe : window) {
    for (const MapPointId point : keyframe->points) {
      if (point) points.insert(point);
    }
  }
  std::map<KeyframeId, int> around;
  for (const MapPointId point : points) {
    for (const FeatureRef& observation : map.FindPoint(point)->observations) ++around[observation.keyframe];
  }
  for (const MapKeyframe* keyframe : window) around.erase(keyframe->id);
  std::vector<std::pair<int, KeyframeId>> anchors;
  for (const auto& [id, count] : around) anchors.emplace_back(count, id);
  std::sort(anchors.rbegin(), anchors.rend());
  if (anchors.size() > kMaxAnchorKeyframes) anchors.resize(kMaxAnchorKeyframes);

  // A small map has no keyframes outside the window: its oldest keyframe is fixed. The observations do not determine
  // the scale; the damping of the solver keeps it.
  KeyframeId anchored;
  if (anchors.empty()) {
    anchored = (*std::min_element(window.begin(), window.end(), [](auto* a, auto* b) { return a->id < b->id; }))->id;
  }

  ProblemBuilder builder(map, config, newest.camera());
  for (const MapKeyframe* keyframe : window) {
    builder.AddKeyframe(*keyframe, keyframe->id == anchored && !keyframe->prior);
  }
  for (const auto& [count, id] : anchors) builder.AddKeyframe(*map.FindKeyframe(id), true);
  for (const MapPointId point : points) builder.AddPoint(*map.FindPoint(point));
  return builder.Take();
}

MapProblem GlobalProblem(const SlamMap& map, const SlamConfig& config, bool find_lens) {
  const MapKeyframe& first = map.keyframes().begin()->second;
  ProblemBuilder builder(map, config, first.camera());
  if (find_lens) builder.FindLens();
  for (const auto& [id, keyframe] : map.keyframes()) builder.AddKeyframe(keyframe, id == first.id && !first.prior);
  for (const auto& [id, track] : map.points()) builder.AddPoint(track);
  return builder.Take();
}

void ApplyWindow(const MapProblem& problem, SlamMap& map) {
  std::map<KeyframeId, Sim3<World, World>> moved;  // transformation of the space around each adjusted or newer keyframe
  for (size_t i = 0; i < problem.keyframes.size(); ++i) {
    if (problem.bundle.cameras[i].fixed) continue;
    const SE3<World, Camera>& after = problem.bundle.cameras[i].T_world_camera;
    moved[problem.keyframes[i]] = Sim3<World, World>(after * problem.before[i].Inverse());
    if (MapKeyframe* keyframe = map.FindKeyframe(problem.keyframes[i])) keyframe->SetPose(after);
  }
  for (auto it = map.keyframes().upper_bound(problem.newest_keyframe); it != map.keyframes().end(); ++it) {
    MapKeyframe& keyframe = it->second;
    const auto parent = moved.find(keyframe.parent);
    if (parent == moved.end() || keyframe.pose_given) continue;
    keyframe.SetPose(parent->second.Moved(keyframe.T_world_camera()));
    moved[keyframe.id] = parent->second;
  }
  for (size_t i = 0; i < problem.points.size(); ++i) {
    const auto it = map.points().find(problem.points[i]);
    if (it != map.points().end()) it->second.point.position_world = problem.bundle.points[i].position_world;
  }
  for (auto it = map.points().upper_bound(problem.newest_point); it != map.points().end(); ++it) {
    PointTrack& track = it->second;
    const auto first = track.observations.empty() ? moved.end() : moved.find(track.observations.front().keyframe);
    if (first != moved.end()) track.point.position_world = first->second * track.point.position_world;
  }
  for (const BundleObservation& observation : problem.bundle.observations) {
    const MapPointId point = problem.points[static_cast<size_t>(observation.point)];
    if (!observation.outlier || !map.points().contains(point)) continue;
    map.RemoveObservation(point, problem.keyframes[static_cast<size_t>(observation.camera)]);
  }
}

void ApplyGlobal(const MapProblem& problem, SlamMap& map) {
  if (problem.bundle.lens) map.CorrectLens(problem.bundle.lens->correction);
  // Transformation of the space around each keyframe.
  std::map<KeyframeId, Sim3<World, World>> moved;
  for (size_t i = 0; i < problem.keyframes.size(); ++i) {
    const SE3<World, Camera>& after = problem.bundle.cameras[i].T_world_camera;
    moved[problem.keyframes[i]] = Sim3<World, World>(after * problem.before[i].Inverse());
  }
  for (auto& [id, keyframe] : map.keyframes()) {
    auto it = moved.find(id);
    if (it == moved.end()) {
      // Parents are older than their children, so the parent's transformation is already known.
      const auto parent = moved.find(keyframe.parent);
      it = moved.emplace(id, parent == moved.end() ? Sim3<World, World>() : parent->second).first;
    }
    if (!keyframe.pose_given) keyframe.SetPose(it->second.Moved(keyframe.T_world_camera()));
  }
  std::set<MapPointId> solved;
  for (size_t i = 0; i < problem.points.size(); ++i) {
    PointTrack* track = map.FindPoint(problem.points[i]);
    if (track == nullptr) continue;
    track->point.position_world = problem.bundle.points[i].position_world;
    solved.insert(track->point.id);
  }
  for (auto& [id, track] : map.points()) {
    if (solved.contains(id) || track.observations.empty()) continue;
    const auto it = moved.find(track.observations.front().keyframe);
    if (it != moved.end()) track.point.position_world = it->second * track.point.position_world;
  }
  for (const BundleObservation& observation : problem.bundle.observations) {
    if (!observation.outlier) continue;
    const KeyframeId keyframe = problem.keyframes[static_cast<size_t>(observation.camera)];
    if (map.FindKeyframe(keyframe) == nullptr) continue;
    map.RemoveObservation(problem.points[static_cast<size_t>(observation.point)], keyframe);
  }
  for (auto& [id, track] : map.points()) map.Refresh(track);
}

}  // namespace romap::slam
