#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/files/sequence.h"

namespace romap::eval {

// What `romap run` stored in summary.json about its input.
struct RunRecord {
  std::optional<std::string> poses = std::nullopt;  // use of the camera poses: "given", "prior" or "none"
  std::optional<size_t> first_frame = std::nullopt;
  std::optional<size_t> frames_sent = std::nullopt;
  std::vector<uint64_t> skipped_frames =
      {};  // ids of the frames between them that were not sent; the first frame has 1
};

// Reads summary.json of the output folder of a run. Missing values and an unreadable file yield nullopt.
RunRecord ReadRunRecord(const std::string& out_dir);

// Timestamps of the frames that the run sent; empty if the record does not determine them.
std::vector<int64_t> FramesOf(const RunRecord& record, const files::Sequence& sequence);

}  // namespace romap::eval
