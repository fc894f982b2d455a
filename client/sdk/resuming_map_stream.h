#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "client/sdk/retry.h"
#include "common/mapping_service.h"

namespace romap::client {

struct ResumeOptions {
  RetryOptions retry;
  size_t max_bytes = 256 << 20;          // of the inputs that are kept
  size_t max_waiting = SIZE_MAX;         // inputs that wait to be sent; then Send() waits
  bool drop_oldest = false;              // for live use: instead of waiting, Send() drops the oldest frame not yet sent
  std::chrono::milliseconds max_age{0};  // frames that waited longer are dropped instead of sent; 0: no limit
  // Called when the link breaks (`attempt` 0), after every attempt to restore it that failed (1, 2, ...), and when it
  // is up again. On another thread, which must not call the stream.
  std::function<void(bool up, const std::string& reason, int attempt)> on_link = {};
};

// A Map stream that survives a broken connection and, if the server has a store, a restart of the server. It keeps a
// copy of every input until the server acknowledged it and, if it has a store, until a Durable event covers it. When
// the stream breaks, it opens another one and sends these again.
//
// The caller sees one stream:
//   - Every input is acknowledged exactly once. An acknowledgement that was lost comes as a duplicate, without a pose.
//   - Objects that are gone after an interruption are reported as removed, then the current objects follow. A MapCopy
//     that applies all events equals the server's map.
//   - A dropped frame is acknowledged as rejected.
//   - If the session is finished during an interruption, its events continue from Watch().
//   - Send() and SendMasks() return as soon as the input is queued. While `max_bytes` or `max_waiting` is reached, they
//     wait. Acknowledgements only arrive while events are read with Next(), so another thread should read them.
//   - The stream ends for the reasons that a server states, e.g. NOT_FOUND after the restart of a server without a
//     store, or with the last error after retry.max_down without progress. FAILED_PRECONDITION: the session was
//     finished before all inputs were accepted.
// Thread-safe.
class ResumingMapStream : public MapStream {
 public:
  // `service` outlives the stream. Waits for the first opening, as for later ones. Errors: those of OpenMap().
  static absl::StatusOr<std::unique_ptr<ResumingMapStream>> Open(MappingService* service, const std::string& session_id,
                                                                 const ResumeOptions& options = {});
  // Waits for an opening in progress.
  ~ResumingMapStream() override;

  const StreamOpening& opening() const override;  // the first one
  std::optional<MapEvent> Next(std::chrono::milliseconds timeout) override;
  bool Done() const override;
  absl::Status status() const override;
  void Cancel() override;
  absl::Status Send(FrameInput frame) override;
  absl::Status SendMasks(MasksInput masks) override;
  absl::Status CloseSend() override;

  uint64_t dropped() const;  // frames
  // Inputs that are kept, because they are not known to be safe on the server. Finish the session when this is 0:
  // inputs that a restarted server lost cannot be sent again to a finished session.
  size_t unsettled() const;
  // Whether the server has acknowledged all inputs on the current stream.
  bool all_answered() const;

 private:
  class Impl;
  explicit ResumingMapStream(std::unique_ptr<Impl> impl);

  const std::unique_ptr<Impl> impl_;
};

}  // namespace romap::client
