#pragma once

#include <string>
#include <vector>

#include "client/cli/map_files.h"
#include "client/files/sequence.h"
#include "client/files/tum.h"
#include "common/status.h"

namespace romap::cli {

// Writes the map in the formats of other tools ("nerfstudio", "colmap", "kitti", "usd") to `dir`. `sequence`: the
// recording that was mapped; may be null, but nerfstudio and colmap need its images (FAILED_PRECONDITION). Errors as
// WriteFile.
absl::Status WriteExports(const std::string& dir, const std::vector<std::string>& formats,
                          const std::vector<MapObject>& objects, const std::vector<files::StampedPose>& trajectory,
                          const files::Sequence* sequence);

}  // namespace romap::cli
