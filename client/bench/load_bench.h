#pragma once

#include <functional>
#include <string>

#include "client/bench/load_results.h"
#include "client/files/sequence.h"
#include "common/mapping_service.h"
#include "common/status.h"

namespace romap::bench {

struct LoadOptions {
  int clients = 4;          // each with a live session of its own
  int viewers = 0;          // that read, spread over the sessions
  int stalled_viewers = 0;  // that subscribe and never read
  double rate_hz = 25;      // of the frames of each client
  double duration_s = 30;
  PoseUse pose_use = PoseUse::kGiven;
};

// Loads a mapping service with clients that send the frames of a sequence at a fixed rate, forward and backward in
// turn, and measures what they and viewers get. A client that is refused is reported and does not try again. The
// sessions are deleted in the end. Calls `progress` with the elapsed share of the time. Polls `stop`, which ends the
// load early. INVALID_ARGUMENT: a frame cannot be read.
absl::StatusOr<LoadResults> RunLoadBench(const files::Sequence& sequence, MappingService& service,
                                         const LoadOptions& options,
                                         const std::function<void(double fraction, const std::string& text)>& progress,
                                         const std::function<bool()>& stop);

}  // namespace romap::bench
