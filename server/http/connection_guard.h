#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

struct bufferevent;
struct evbuffer;
struct evbuffer_cb_info;

namespace romap::http {

// Bounds what connections cost: their number, in all and from one address, the memory of requests that are being
// received, and the time that a client takes to send a request or to read a response. evhttp 2.1 has no such limits.
// On the loop's thread.
class ConnectionGuard {
 public:
  struct Limits {
    size_t total = 512;
    size_t per_peer = 256;
    size_t received_bytes = size_t{64} << 20;  // of all requests that are not answered yet
    std::chrono::milliseconds request_timeout{20'000};
    std::chrono::milliseconds response_timeout{120'000};
  };

  explicit ConnectionGuard(const Limits& limits) : limits_(limits) {}
  ~ConnectionGuard();

  // A connection was accepted. It gets its socket after this call, so call Inspect() before the loop waits for input.
  // `is_usable`: false to close it.
  void Add(bufferevent* connection, bool is_usable);
  // Closes the new connections that exceed the limits, and follows the others.
  void Inspect();
  // The request of a connection was received / its response is being sent / is a stream without end / was sent.
  void OnRequest(int fd) { SetState(fd, State::kWorking); }
  void OnResponse(int fd) { SetState(fd, State::kSending); }
  void OnStream(int fd) { SetState(fd, State::kStreaming); }
  void OnSent(int fd) { SetState(fd, State::kReceiving); }
  // Closes connections that took too long. Call about every second.
  void Sweep();

  size_t connections() const { return connections_.size(); }  // some may have been closed since Sweep()

 private:
  using Clock = std::chrono::steady_clock;
  enum class State { kReceiving, kWorking, kSending, kStreaming };
  struct Connection {
    ConnectionGuard* guard = nullptr;
    int fd = -1;
    ino_t inode = 0;  // a descriptor with another inode belongs to another file: the connection was closed
    std::string peer;
    State state = State::kReceiving;
    Clock::time_point since;
    size_t received_bytes = 0;
  };

  void SetState(int fd, State state);
  void Follow(bufferevent* connection, bool is_usable);
  void ForgetClosed();
  bool HasRoomFor(const std::string& peer) const;
  void NoteRefused(const std::string& peer);
  static void OnInput(evbuffer* buffer, const evbuffer_cb_info* info, void* connection);

  const Limits limits_;
  std::vector<std::pair<bufferevent*, bool>> added_;  // with a reference each, and whether they are usable
  std::map<int, Connection> connections_;             // by descriptor
  size_t received_bytes_ = 0;
  uint64_t refused_ = 0;  // since the last message
  Clock::time_point next_message_ = Clock::now();
};

}  // namespace romap::http
