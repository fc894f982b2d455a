#pragma once

#include <absl/status/status.h>

#include "common/stage_messages.h"
#include "server/nerf/training_box.h"

namespace romap::nerf {

// INVALID_ARGUMENT, with object, keyframe and reason, if the view cannot be trained on: no keyframe id, invalid camera
// or one with distortion, pose not finite, crop outside the image, an image whose size or type does not match the crop,
// too few object pixels, or a box behind the camera.
absl::Status ValidateView(const ObjectView& view, const TrainingBox& box);

}  // namespace romap::nerf
