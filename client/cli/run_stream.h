#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "client/cli/map_collector.h"
#include "client/files/sequence.h"
#include "client/files/tum.h"
#include "common/diagnostic.h"
#include "common/mapping_service.h"

namespace romap::cli {

struct StreamOptions {
  PoseUse pose_use = PoseUse::kGiven;
  std::optional<Eigen::Vector3d> up_world = std::nullopt;  // see SessionOptions
  bool estimate_up = false;
  std::string session_name;
  bool realtime = false;    // send at the recorded rate; the server drops frames when overloaded
  double mask_rate_hz = 0;  // maximum rate of frames with masks, by timestamps; 0 = unlimited
  double mask_delay_s = 0;  // delay of masks after their frame, by timestamps; 0 = sent with the frame
  size_t first_frame = 0;
  size_t frame_count = SIZE_MAX;  // from the first frame on, sent or not
  size_t stride = 1;              // send every `stride`-th of these
  size_t hold_out = 0;            // do not send one of this number of frames, see HeldOutFrames(); 0: send all
  double max_training_s = 600;    // maximum wait for training after the last frame
  std::string session_id;         // the open session to continue; empty: a new one
  bool leave_open = false;        // do not finish the session, so that it can be continued
  bool say_diagnostics = true;    // print each when it arrives
  bool resume = false;            // over a network: survive a broken connection and a restart of the server
};

struct StreamResult {
  std::string session_id;
  bool durable = false;      // the server stores the session
  size_t first_frame = 0;    // index of the first frame that the session has
  size_t frames_before = 0;  // that a continued session had, if it had all
  absl::Status status;       // not OK if the stream failed; the collector has the events received before
  // The final trajectory of the map, including later corrections. nullopt if the stream failed or the map could not be
  // exported.
  std::optional<std::vector<files::StampedPose>> trajectory;
  bool interrupted = false;
  bool training_complete = false;
  double mapping_s = 0;                  // from the first sent frame to the last acknowledgement
  double training_s = 0;                 // from then to the end of training
  std::vector<Diagnostic> diagnostics;   // about files that could not be read
  std::vector<Diagnostic> said;          // diagnostics that were printed, as they were then
  std::vector<uint64_t> skipped_frames;  // ids of the frames whose image could not be read, or that are held out
};

// Indices of the frames that StreamOptions::hold_out keeps back, evenly spread. Textures are compared with them.
std::vector<size_t> HeldOutFrames(const files::Sequence& sequence, const StreamOptions& options);

// Streams a sequence to a mapping service and collects the map: creates a session, sends every frame, waits for all
// acknowledgements, finishes the session and waits for the training. An interrupt ends sending and training early. The
// caller deletes the session when it has saved the map.
// Shows a progress bar, and above it each diagnostic when it arrives. Skips images, masks and depth images that cannot
// be read; too many of them end sending with an error. Returns an error if no session could be opened. Later errors are
// in StreamResult::status; the session then stays on the server.
absl::StatusOr<StreamResult> StreamSequence(const files::Sequence& sequence, MappingService& service,
                                            const StreamOptions& options, MapCollector& collector);

// What the client noticed while sending, then what the server noticed.
std::vector<Diagnostic> DiagnosticsOf(const StreamResult& result, const MapCollector& collector);

}  // namespace romap::cli
