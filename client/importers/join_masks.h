#pragma once

#include <string>
#include <vector>

#include "client/importers/recording_contents.h"
#include "common/status.h"

namespace romap::importers {

// Gives the frames of a recording the masks at `path` (as it is, or in the folder `source`): a folder of label images,
// instance images or YOLO segmentations, or a COCO file; README.md describes them. Masks belong to the frame whose name
// or, if no name fits, number is that of the mask. Adds the diagnostic masks_joined. NOT_FOUND: `path` does not exist.
// INVALID_ARGUMENT: it has no masks, or none fits a frame.
absl::Status JoinMasks(const std::string& path, const std::string& source, RecordingContents* contents);

// Marks the black pixels of RecordedFrame::ignore_mask as unknown in the masks of frames that have masks.
void ApplyIgnoreMasks(RecordingContents* contents);

// Gives each frame its mask file (empty: none). Files that are black and white (0 and 255 only) become ignore masks,
// all others label images. Decides by a few of the files.
void SetMasks(const std::vector<std::string>& paths, RecordingContents* contents);

}  // namespace romap::importers
