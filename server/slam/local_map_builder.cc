#include "server/slam/local_map_builder.h"

#include <algorithm>
#include <vector>

#include "server/slam/covisibility.h"
#include "server/slam/point_maker.h"

namespace romap::slam {
namespace {

constexpr size_t kNeighbors = 20;
constexpr size_t kSecondNeighbors = 5;          // of each of those
constexpr uint64_t kNewestKeyframes = 60;       // their poses are included in addition to those of the neighbors
constexpr int kMinObservationsOfGoodPoint = 3;  // or the number of keyframes if the map has fewer

// Number of well-observed points among the scene features, the kind of features that all frames have.
int CountReferencePoints(const SlamMap& map, const MapKeyframe& reference) {
  const int min_observations = std::min(kMinObservationsOfGoodPoint, static_cast<int>(map.keyframes().size()));
  int count = 0;
  for (size_t i = 0; i < reference.scene_features; ++i) {
    const MapPointId id = reference.points[i];
    count += id && map.FindPoint(id)->point.observations >= min_observations ? 1 : 0;
  }
  return count;
}

}  // namespace

std::shared_ptr<const LocalMap> MakeLocalMap(const SessionMap& session_map, int generation) {
  const SlamMap& map = session_map.map;
  const KeyframeId reference = session_map.reference;
  auto local = std::make_shared<LocalMap>();
  local->keyframes_done = map.keyframe_count();
  local->generation = generation;
  local->map = session_map.id;
  local->lens = map.lens();
  if (session_map.world_is_given) local->up_world = session_map.given_up_world;
  local->reference = reference;
  local->relocalized = session_map.relocalized;
  const MapKeyframe* center = map.FindKeyframe(reference);
  if (center == nullptr) return local;

  std::vector<KeyframeId> keyframes = Neighborhood(map, *center, kNeighbors, kSecondNeighbors);
  keyframes.insert(keyframes.begin(), reference);
  for (const MapPointId id : PointsOf(map, keyframes)) {
    local->index[id] = static_cast<int>(local->points.size());
    local->points.push_back(MakeLocalPoint(*map.FindPoint(id)));
  }
  local->reference_points = CountReferencePoints(map, *center);
  local->reference_uncertainty = center->uncertainty;

  const uint64_t newest = map.keyframe_count();
  for (uint64_t id = newest > kNewestKeyframes ? newest - kNewestKeyframes : 1; id <= newest; ++id) {
    keyframes.push_back(KeyframeId{id});
  }
  for (const KeyframeId id : keyframes) {
    if (const auto pose = map.KeyframePose(id)) local->keyframes[id] = *pose;
  }
  return local;
}

}  // namespace romap::slam
