#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/cli/map_files.h"
#include "client/files/sequence.h"
#include "client/files/tum.h"

namespace romap {

// Writes below `dir`/pictures: <id>_<class>.png, each object's mesh shaded beside its best view; map.png, the whole map
// from above; and frame_<n>.png, the cuboids drawn into a few frames. `trajectory` holds the camera poses of the frames
// that were mapped.
absl::Status WriteMapPictures(const std::string& dir, const Sequence& sequence,
                              const std::vector<StampedPose>& trajectory, const std::vector<MapObject>& objects);

}  // namespace romap
