#pragma once

#include <absl/status/status.h>

#include <Eigen/Core>
#include <span>
#include <vector>

#include "common/field_snapshot.h"

namespace romap::texture {

// Whether a texture can be taken from a view. INVALID_ARGUMENT, with the fault in the message: a pose or camera that is
// not finite, a lens with distortion, an empty crop, or images of another type or size.
absl::Status ValidateTextureView(const TrainingCamera& view);

// Pixels per map unit at a point (Object frame), of each view that it is in front of.
std::vector<double> ResolutionsAt(std::span<const TrainingCamera> views, const Eigen::Vector3f& point);

}  // namespace romap::texture
