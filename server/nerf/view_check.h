#pragma once

#include <absl/status/status.h>

#include "common/stage_messages.h"
#include "server/nerf/training_box.h"

namespace romap::nerf {

// INVALID_ARGUMENT, naming object, keyframe and fault, for a view that cannot be trained on: no keyframe, bad camera or
// a distorted one, pose not finite, crop outside the image, an image of another size or type than the crop needs, fewer
// than a few object pixels, or a box that lies behind the camera.
absl::Status ValidateView(const ObjectView& view, const TrainingBox& box);

}  // namespace romap::nerf
