// The part of ObjectMapper that follows corrections of the map.

#include <algorithm>

#include "common/map_motion.h"
#include "server/objects/object_mapper.h"

namespace romap::objects {
namespace {

// A place that stands for all of a landmark.
Eigen::Vector3d CenterOf(const Landmark& landmark) {
  if (landmark.cuboid) return landmark.cuboid->T_world_object.translation();
  if (landmark.body_world.empty()) return landmark.last_T_world_camera.translation();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : landmark.body_world) sum += p;
  return sum / static_cast<double>(landmark.body_world.size());
}

bool IsUsable(const KeyframeCorrection& keyframe) {
  return keyframe.T_world_camera.IsFinite() && keyframe.S_new_old.IsFinite();
}

}  // namespace

ObjectOutput ObjectMapper::Correct(const MapCorrection& correction) {
  ObjectOutput output;
  registry_.MovePoints(correction.points);
  if (correction.up_world.allFinite() && correction.up_world.norm() > 0.5) up_world_ = correction.up_world.normalized();
  KeyframeCorrections keyframes;
  for (const KeyframeCorrection& keyframe : correction.keyframes) {
    if (IsUsable(keyframe)) keyframes[keyframe.id] = keyframe;
  }
  history_.Correct(&keyframes);
  const auto last = keyframes.find(last_keyframe_);
  if (last != keyframes.end()) scene_depth_mu_ *= last->second.S_new_old.scale();
  for (const auto& landmark : landmarks_) CorrectLandmark(*landmark, keyframes);
  for (const auto& landmark : landmarks_) {
    if (landmark->published) Publish(*landmark, /*force=*/false, &output);
  }
  return output;
}

void ObjectMapper::CorrectLandmark(Landmark& landmark, const KeyframeCorrections& keyframes) {
  const auto S_new_old = MeanMotion(landmark.keyframes, CenterOf(landmark), keyframes);
  if (S_new_old) {
    landmark.S_now_told = *S_new_old * landmark.S_now_told.value_or(Sim3<World, World>());
    if (landmark.cuboid) landmark.cuboid = Moved(*S_new_old, *landmark.cuboid);
    if (landmark.reach) landmark.reach = Moved(*S_new_old, *landmark.reach);
    for (Eigen::Vector3d& p : landmark.body_world) p = *S_new_old * p;
    landmark.last_T_world_camera = S_new_old->Moved(landmark.last_T_world_camera);
  }
  if (landmark.cuboid) landmark.cuboid = Upright(*landmark.cuboid, up_world_);
  if (landmark.reach) landmark.reach = Upright(*landmark.reach, up_world_);
  if (!S_new_old) return;
  landmark.needs_fit |= landmark.shape.Correct(*S_new_old, keyframes, landmark.cuboid);
  landmark.views.Correct(*S_new_old, keyframes);
}

}  // namespace romap::objects
