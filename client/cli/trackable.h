#pragma once

#include <map>
#include <vector>

#include "client/cli/map_files.h"
#include "client/files/sequence.h"
#include "client/files/tum.h"

namespace romap::cli {

// For each object the index of the first mapped frame in which it could be tracked. It counts as seen in a frame when
// its cuboid lies wholly in the image and a mask of at least kTrackableArea_px pixels fits the cuboid's outline; it
// could be tracked once it was seen from two directions kTrackableParallax_rad apart, because one direction does not
// say where a thing is. Objects without such a frame are left out.
std::map<ObjectId, size_t> FirstTrackableFrames(const files::Sequence& sequence,
                                                const std::vector<files::StampedPose>& trajectory,
                                                const std::vector<MapObject>& objects);

inline constexpr int kTrackableArea_px = 300;
inline constexpr double kTrackableParallax_rad = 0.087;  // 5 degrees

}  // namespace romap::cli
