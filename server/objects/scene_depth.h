#pragma once

#include "common/stage_messages.h"
#include "server/objects/correction.h"

namespace romap::objects {

// A typical distance of the scene from the camera: the median z depth of the map points in the last keyframe.
class SceneDepth {
 public:
  // Unchanged when the keyframe has no points in front of the camera.
  void Update(const KeyframeView& view);
  // Follows the scale corrections of the last keyframe.
  void Correct(const KeyframeCorrections& keyframes);

  double value_mu() const { return depth_mu_; }  // 0 = unknown

 private:
  double depth_mu_ = 0;
  KeyframeId keyframe_;
};

}  // namespace romap::objects
