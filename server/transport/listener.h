#pragma once

#include <absl/status/statusor.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "common/host_port.h"

namespace romap::transport {

struct ConnectionLimits {
  int total = 512;
  int per_peer = 256;
};

// At most as many connections as the process may open files, less those that it needs for itself.
ConnectionLimits WithinFileLimit(ConnectionLimits limits);

// Listens on an address and accepts connections up to the limits. gRPC 1.51 accepts without limits, and stops accepting
// for good when the process may open no more files.
class Listener {
 public:
  // Gets the socket of a new connection, which it owns from then on.
  using Handler = std::function<void(int fd)>;

  // UNAVAILABLE: cannot listen there.
  static absl::StatusOr<std::unique_ptr<Listener>> Open(const HostPort& address);
  ~Listener();  // Stop()

  int port() const { return port_; }
  // Accepted and not closed yet. Thread-safe.
  int OpenConnections();
  // Begins to accept.
  void Start(const ConnectionLimits& limits, Handler handler);
  // Ends listening; the handler is not called any more.
  void Stop();

 private:
  using Clock = std::chrono::steady_clock;
  // A connection that was accepted. Its owner closes the socket at some time; then the descriptor is not open any more,
  // or belongs to another file.
  struct Connection {
    uint64_t inode = 0;
    std::string peer;
  };

  Listener() = default;
  bool Bind(const void* addrinfo);
  void Run();
  void Accept(int listening_fd);
  bool Register(int fd, const std::string& peer);
  void ForgetClosed();
  bool HasRoomFor(const std::string& peer) const;
  void NoteRefused(const std::string& peer);

  std::vector<int> listening_fds_;
  int stop_fd_ = -1;
  int port_ = 0;
  ConnectionLimits limits_;
  Handler handler_;
  std::thread thread_;

  std::mutex mutex_;
  std::map<int, Connection> connections_;  // by descriptor; guarded by mutex_
  // The thread's.
  uint64_t refused_ = 0;  // since the last message
  Clock::time_point next_message_ = Clock::now();
};

}  // namespace romap::transport
