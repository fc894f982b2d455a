#pragma once

#include <span>
#include <string>
#include <vector>

#include "client/cli/map_files.h"
#include "client/files/sequence.h"
#include "client/files/tum.h"

namespace romap::cli {

// Writes images to `dir`/pictures: <id>_<class>.png shows the mesh of each object beside its best view, map.png shows
// the whole map from above, and cuboids_<n>.jpg are those of WriteCuboidPictures. `trajectory` has the camera poses of
// the mapped frames. Errors as Sequence::Load and WriteFile.
absl::Status WriteMapPictures(const std::string& dir, const files::Sequence& sequence,
                              const std::vector<files::StampedPose>& trajectory, const std::vector<MapObject>& objects);

// Writes cuboids_<n>.jpg to `folder` (created if missing): a few frames of the sequence (n = frame number from 1) with
// the cuboids, ids and classes drawn from the poses of `trajectory`. Distorted images are undistorted first. Errors as
// Sequence::Load and WriteFile.
absl::Status WriteCuboidPictures(const std::string& folder, const files::Sequence& sequence,
                                 const std::vector<files::StampedPose>& trajectory,
                                 std::span<const ObjectUpdate> objects);

}  // namespace romap::cli
