#pragma once

#include <cstddef>
#include <vector>

#include "client/files/tum.h"

namespace romap::files {

// Removes rows that stand for "no pose": exactly the identity, while the poses around them are elsewhere. Some programs
// write it while they have lost the camera. A camera that starts or rests at the origin keeps its poses, because the
// pose before or after is near. `poses`: in order of time. Returns the number of removed rows.
size_t RemovePlaceholders(std::vector<StampedPose>* poses);

}  // namespace romap::files
