#pragma once

#include <string>

#include "client/files/sequence.h"
#include "client/importers/sequence_reader.h"
#include "common/status.h"

namespace romap::importers {

// Opens a recording of any known layout without loading its images. INVALID_ARGUMENT: its layout is unknown (the
// message states what was looked for and what was found), or something in it is malformed. NOT_FOUND: it does not
// exist, or more than files::kMaxUnreadableShare of its images, masks or depth images are missing.
absl::StatusOr<files::Sequence> OpenRecording(const std::string& source, const ReadOptions& options = {});

}  // namespace romap::importers
