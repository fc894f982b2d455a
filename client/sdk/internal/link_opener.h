#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "common/mapping_service.h"

namespace romap::client {

// Opens the streams of a ResumingMapStream and decides which errors are worth another attempt. Not thread-safe.
class LinkOpener {
 public:
  struct Link {
    std::shared_ptr<EventStream> events;
    std::shared_ptr<MapStream>
        inputs;  // the same stream; null: the session is finished, and its events come from Watch
  };
  // What must be on the server before it is enough to watch a finished session.
  struct Kept {
    size_t unacknowledged = 0;
    std::optional<uint64_t> newest_frame_id;
  };
  struct Attempt {
    absl::Status status;  // OK: `link` is open
    Link link;
    bool retry = false;  // the next attempt may succeed
  };

  LinkOpener(MappingService* service, std::string session_id) : service_(service), session_id_(std::move(session_id)) {}

  // `broken`: how the last stream ended; OK before the first one.
  Attempt Open(const absl::Status& broken, const Kept& kept);
  // Whether a stream that ended with `status` is worth another one.
  bool MayReopen(const absl::Status& status);

 private:
  Attempt Failed(const absl::Status& status, bool retry);
  Attempt OpenFinished(const absl::Status& refusal, const absl::Status& broken, const Kept& kept);

  MappingService* const service_;
  const std::string session_id_;
  std::string token_;
  int unanswered_ = 0;  // openings without an answer, which may still reach the server
};

}  // namespace romap::client
