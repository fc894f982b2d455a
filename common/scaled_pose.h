#pragma once

#include "common/geometry.h"

namespace romap {

// The same motion in other units of length: its translation times `scale`.
template <class To, class From>
SE3<To, From> ScaleTranslation(const SE3<To, From>& T, double scale) {
  return {T.rotation(), scale * T.translation()};
}

// A keyframe's pose and the change of the map's scale around it since the keyframe was created.
struct ScaledPose {
  SE3<World, Camera> T_world_camera;
  double scale = 1;  // product of all scale corrections, > 0

  // The pose of a frame that is anchored to this keyframe. The translation of `T_this_frame` is in map units of the
  // time when the keyframe was made, as in TrackedFrame::T_reference_camera.
  SE3<World, Camera> Compose(const SE3<Camera, Camera>& T_this_frame) const {
    return T_world_camera * ScaleTranslation(T_this_frame, scale);
  }

  // The inverse of Compose.
  SE3<Camera, Camera> Relative(const SE3<World, Camera>& T_world_frame) const {
    const SE3<Camera, Camera> T_this_frame = T_world_camera.Inverse() * T_world_frame;
    return {T_this_frame.rotation(), T_this_frame.translation() / scale};
  }
};

}  // namespace romap
