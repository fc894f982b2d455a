#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/files/time_unit.h"
#include "common/client_input.h"
#include "common/status.h"

namespace romap::files {

// All detections with the same timestamp.
struct DetectionSet {
  int64_t timestamp_ns = 0;
  int line = 0;     // of its first row
  size_t rows = 0;  // more than `instances` if labels are repeated
  std::vector<Instance> instances;
};

// The contents of detections.csv.
struct DetectionFile {
  std::vector<DetectionSet> sets;  // timestamps strictly increase
  TimeUnit unit = TimeUnit::kSeconds;
  bool scores_in_percent = false;  // scores were 0..100 and are now 0..1
  // Some timestamp lists a label several times: it is rounded and stands for several frames.
  bool timestamps_repeat = false;
  int64_t resolution_ns = 1;  // largest power of ten, up to 1 s, that divides all timestamps
};

// Reads rows of `timestamp,label,class[,score]`, with or without a header. Scores are 0..1 or, if one is larger,
// 0..100. A label that is repeated at one timestamp must have the same class each time; its scores are averaged.
// INVALID_ARGUMENT names the file and the line. Otherwise as ReadCsv.
absl::StatusOr<DetectionFile> ReadDetections(const std::string& path);

// The set of each mask; -1: none. Takes the nearest pairs first, one to one. Their distance is at most `max_dt_ns`, or
// what the rounding of the timestamps explains if that is less than half of the period of the masks. If timestamps
// repeat, each mask takes the set of the nearest timestamp within either distance.
std::vector<int64_t> MatchDetections(const DetectionFile& file, std::span<const int64_t> mask_times_ns,
                                     int64_t max_dt_ns);

}  // namespace romap::files
