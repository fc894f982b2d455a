#pragma once

#include <absl/status/statusor.h>

#include <chrono>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "common/mapping_service.h"
#include "server/access/authenticator.h"
#include "server/http/event_loop.h"
#include "server/http/exchange.h"
#include "server/http/worker_pool.h"

namespace romap::http {

// Feeds sessions with images from POST requests: holds the Map stream of each such session and answers a request with
// the acknowledgment of its frame. At most two frames of a session are on their way. On the loop's thread.
class FrameFeeds {
 public:
  // All outlive the object.
  FrameFeeds(const access::Authenticator* authenticator, EventLoop* loop, WorkerPool* pool)
      : authenticator_(authenticator), loop_(loop), pool_(pool) {}
  ~FrameFeeds();

  // Answers with a FrameAck, or with an error: INVALID_ARGUMENT: frame_id or timestamp_ns is missing or not a number.
  // FAILED_PRECONDITION: the session is not live, accepts no frames, or another client feeds it. RESOURCE_EXHAUSTED:
  // two frames are on their way.
  void Post(const std::string& session_id, HttpRequest request, std::unique_ptr<Exchange> exchange);
  // Call about every 10 ms: answers acknowledged frames, and closes streams that got no frame for 30 s.
  void Pump();

  size_t size() const { return feeds_.size(); }

 private:
  using Clock = std::chrono::steady_clock;
  struct WaitingFrame {
    std::unique_ptr<Exchange> exchange;
    Clock::time_point since;
  };
  struct Feed {
    uint64_t number = 0;                      // differs from that of an earlier feed with the same key
    std::shared_ptr<MapStream> stream;        // null while it is being opened
    bool is_sending = false;                  // a worker opens the stream or sends a frame
    std::map<uint64_t, WaitingFrame> frames;  // without acknowledgment
    Clock::time_point last_used;
  };
  // A session and the authorization of the client: another client gets what the service says to it.
  using Key = std::pair<std::string, std::string>;
  struct Sent {
    std::shared_ptr<MapStream> stream;
    absl::Status status;
  };

  // On a worker.
  Sent Send(const Key& key, std::shared_ptr<MapStream> stream, FrameInput frame) const;
  void OnSent(const Key& key, uint64_t number, uint64_t frame_id, Sent sent);
  // False: the stream has ended.
  static bool Pump(Feed& feed, Clock::time_point now);
  void Close(Feed& feed, const absl::Status& reason);

  const access::Authenticator* const authenticator_;
  EventLoop* const loop_;
  WorkerPool* const pool_;
  std::map<Key, Feed> feeds_;
  uint64_t feeds_opened_ = 0;
};

}  // namespace romap::http
