#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client/files/detections.h"
#include "client/files/time_unit.h"
#include "common/diagnostic.h"

namespace romap::files {

// The findings about the files of a sequence. client/README.md lists their codes. `file` is a name in the sequence
// folder; all times must not be empty.

// Files whose timestamps are not in seconds.
Diagnostic TimestampsConverted(std::span<const std::pair<std::string, TimeUnit>> files);

// No entry of a file matches a frame in time. `entries`: "poses", "masks" or "depth images". `code`: e.g.
// "masks_unmatched".
Diagnostic UnmatchedInTime(const std::string& code, const std::string& entries, const std::string& file,
                           std::span<const int64_t> times_ns, std::span<const int64_t> frame_times_ns);

// Rows that RemovePlaceholders() removed.
Diagnostic PosesPlaceholder(const std::string& file, size_t rows);

// `posed` of `frames` frames have a pose; `first_frame_id` is the first without.
Diagnostic PosesPartial(const std::string& file, size_t posed, size_t frames, uint64_t first_frame_id);

// Rows that match no mask. `matched`: for each set, whether it belongs to a mask.
Diagnostic DetectionsUnmatched(const std::string& file, const DetectionFile& detections,
                               const std::vector<bool>& matched, size_t masks_without);

Diagnostic DetectionsRepeat(const std::string& file, const DetectionFile& detections);
Diagnostic ScoresInPercent(const std::string& file);

}  // namespace romap::files
