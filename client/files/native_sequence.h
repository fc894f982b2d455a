#pragma once

#include <string>

#include "client/files/sequence.h"
#include "client/files/sequence_contents.h"
#include "common/status.h"

namespace romap::files {

// Reads the lists of a folder in the native layout, not the images: rgb.txt and camera.yaml, and optionally mask.txt,
// detections.csv, depth.txt, groundtruth.txt and objects.yaml. Entries of the lists are associated with those of
// rgb.txt by time, one to one, within half a frame period; detections with the masks. The instances of a frame are the
// detections at the time of the mask or, without a detections file, all objects of objects.yaml. The pose is
// interpolated; it is absent if none is within 20 ms. INVALID_ARGUMENT: a malformed line (the message names the file
// and the line), timestamps that do not increase, or no frames. Otherwise as ReadFileList, e.g. NOT_FOUND if a required
// file is missing.
absl::StatusOr<SequenceContents> ReadNativeSequence(const std::string& dir, const SequenceOptions& options);

}  // namespace romap::files
