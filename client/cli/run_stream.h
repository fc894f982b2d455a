#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/map_collector.h"
#include "client/files/sequence.h"
#include "client/files/tum.h"
#include "common/mapping_service.h"

namespace romap::cli {

struct StreamOptions {
  PoseUse pose_use = PoseUse::kGiven;
  std::string session_name;
  bool realtime = false;    // send at the recorded rate and let the server drop what it cannot keep up with
  double mask_rate_hz = 0;  // frames whose masks are sent, per second of timestamps; 0 = all
  double mask_delay_s = 0;  // masks come so much later than their frame, by timestamps; 0 = with it
  size_t first_frame = 0;
  size_t frame_count = SIZE_MAX;
  double max_training_s = 600;  // longest wait for training after the last frame
  bool keep_session = false;    // leave the session on the server
};

struct StreamResult {
  std::string session_id;
  absl::Status status;  // not OK: the stream broke; the collector holds what came until then
  // The map's, with all corrections that came after the frames were acknowledged. nullopt: the stream broke, or the map
  // could not be fetched.
  std::optional<std::vector<files::StampedPose>> trajectory;
  bool interrupted = false;
  bool training_complete = false;
  double mapping_s = 0;   // from the first frame sent to the last acknowledged
  double training_s = 0;  // from then to the end of training
};

// Streams a sequence through a mapping service and collects the map: creates a session, sends every frame, waits until
// all are acknowledged, finishes the session and waits for the training. Ctrl-C ends the sending, and the training:
// what there is by then is the map. Shows a progress bar. Fails only when there is no session to begin with; what goes
// wrong later is in the result, and then the session is left on the server.
absl::StatusOr<StreamResult> StreamSequence(const files::Sequence& sequence, MappingService& service,
                                            const StreamOptions& options, MapCollector& collector);

}  // namespace romap::cli
