#pragma once

#include <absl/status/status.h>

#include "common/field_snapshot.h"

namespace romap::texture {

// Whether a texture can be taken from a view. INVALID_ARGUMENT, with the fault in the message: a pose or camera that is
// not finite, a lens with distortion, an empty crop, or images of another type or size.
absl::Status ValidateTextureView(const TrainingCamera& view);

}  // namespace romap::texture
