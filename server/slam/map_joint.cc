#include "server/slam/map_joint.h"

#include <utility>

#include "server/slam/loop_closer.h"

namespace romap::slam {
namespace {

KeyframeId RootOf(const SlamMap& map, KeyframeId id) {
  while (map.FindKeyframe(id)->parent) id = map.FindKeyframe(id)->parent;
  return id;
}

// A parent is older than its children, so the root that is newer becomes a child.
void JoinTrees(const LoopMatch& seam, SlamMap& map) {
  KeyframeId older = seam.old;
  KeyframeId newer = seam.newest;
  KeyframeId older_root = RootOf(map, older);
  KeyframeId newer_root = RootOf(map, newer);
  if (newer_root < older_root) {
    std::swap(older, newer);
    std::swap(older_root, newer_root);
  }
  map.FindKeyframe(newer_root)->parent = older < newer_root ? older : older_root;
}

}  // namespace

std::optional<MapJoint> MakeJoint(const CommonPlace& place, const SessionMap& current, const SessionMap& kept) {
  const auto S_kept_current = place.Alignment(current.map, kept.map);
  if (!S_kept_current) return std::nullopt;
  bool into_kept = kept.map.keyframes().size() >= current.map.keyframes().size();
  if (current.has_depth_scale != kept.has_depth_scale) into_kept = kept.has_depth_scale;
  // The client's world stays where it is.
  if (current.world_is_given != kept.world_is_given) into_kept = kept.world_is_given;
  MapJoint joint;
  if (into_kept) {
    joint.maps = {.from = current.id, .into = kept.id};
    joint.S_into_from = *S_kept_current;
    joint.seam = {.newest = place.keyframe, .old = place.kept_keyframe, .same_points = place.same_points};
  } else {
    joint.maps = {.from = kept.id, .into = current.id};
    joint.S_into_from = S_kept_current->Inverse();
    joint.seam = {.newest = place.kept_keyframe, .old = place.keyframe};
    for (const auto& [of_current, of_kept] : place.same_points) {
      joint.seam.same_points.emplace_back(of_kept, of_current);
    }
  }
  return joint;
}

void ConnectParts(const MapJoint& joint, const SlamConfig& config, SlamMap& map) {
  LoopMatch seam = joint.seam;
  MapKeyframe& newest = *map.FindKeyframe(seam.newest);
  MapKeyframe& old = *map.FindKeyframe(seam.old);
  JoinTrees(seam, map);
  seam.S_old_newest = Sim3<Camera, Camera>(old.T_camera_world() * newest.T_world_camera());
  newest.loops.emplace_back(seam.old, seam.S_old_newest.Inverse());
  old.loops.emplace_back(seam.newest, seam.S_old_newest);
  FuseSides(seam, config, map);
}

}  // namespace romap::slam
