#pragma once

#include <span>
#include <string>
#include <vector>

#include "client/cli/map_files.h"
#include "client/files/sequence.h"
#include "client/files/tum.h"

namespace romap::cli {

// Writes below `dir`/pictures: <id>_<class>.png, each object's mesh shaded beside its best view; map.png, the whole map
// from above; and what WriteCuboidPictures writes. `trajectory` holds the camera poses of the frames that were mapped.
absl::Status WriteMapPictures(const std::string& dir, const files::Sequence& sequence,
                              const std::vector<files::StampedPose>& trajectory, const std::vector<MapObject>& objects);

// Writes into `folder`, which is made, cuboids_<n>.jpg: the cuboids with id and class drawn into a few frames of the
// sequence, n counted from 1, as they would look from the poses of `trajectory`. Images with lens distortion are
// undistorted first. Errors as Sequence::Load, and INVALID_ARGUMENT when a file cannot be written.
absl::Status WriteCuboidPictures(const std::string& folder, const files::Sequence& sequence,
                                 const std::vector<files::StampedPose>& trajectory,
                                 std::span<const ObjectUpdate> objects);

}  // namespace romap::cli
