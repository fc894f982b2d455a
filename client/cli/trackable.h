#pragma once

#include <map>
#include <vector>

#include "client/cli/map_files.h"
#include "client/files/sequence.h"
#include "client/files/tum.h"

namespace romap::cli {

// For each object, the index of the first mapped frame in which it was trackable; objects that never were are omitted.
// An object is visible in a frame if its cuboid is completely in the image and a mask of at least kTrackableArea_px
// pixels fits the outline of the cuboid. It is trackable after it was visible from two directions that differ by
// kTrackableParallax_rad, because a single direction does not determine its position.
std::map<ObjectId, size_t> FirstTrackableFrames(const files::Sequence& sequence,
                                                const std::vector<files::StampedPose>& trajectory,
                                                const std::vector<MapObject>& objects);

inline constexpr int kTrackableArea_px = 300;
inline constexpr double kTrackableParallax_rad = 0.087;  // 5 degrees

}  // namespace romap::cli
