#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "client/files/sequence.h"
#include "common/status.h"

namespace romap::importers {

struct ImportCounts {
  size_t frames = 0, masks = 0, depth_images = 0, poses = 0;
};

// Writes a sequence in the native layout to a new or empty folder. Files that need no change become hard links, or
// copies if the folder is on another file system. Calls `proceed` after each frame, with their number; false ends with
// CANCELLED. Frames whose image cannot be read are left out, as are masks and depth images that cannot be read.
// FAILED_PRECONDITION: the folder is not empty. INVALID_ARGUMENT: more than files::kMaxUnreadableShare of the images
// cannot be read. Otherwise as WriteFile.
absl::StatusOr<ImportCounts> WriteNativeSequence(const files::Sequence& sequence, const std::string& folder,
                                                 const std::function<bool(size_t)>& proceed);

}  // namespace romap::importers
