#pragma once

#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <thread>

namespace romap::testing_support {

// A TCP proxy on loopback between a client and a server, whose link can be damaged. Thread-safe.
class LinkProxy {
 public:
  // `server`: HOST:PORT with a numeric IPv4 address. Listens on a free port.
  explicit LinkProxy(const std::string& server);
  ~LinkProxy();
  LinkProxy(const LinkProxy&) = delete;
  LinkProxy& operator=(const LinkProxy&) = delete;

  const std::string& address() const { return address_; }

  // Closes all connections; `for_how_long`: closes new ones at once.
  void Cut(std::chrono::milliseconds for_how_long);
  // Nothing passes, but no connection is closed.
  void Stall(bool stall) { stalled_ = stall; }
  // Every piece of up to 64 kB passes so much later.
  void SetDelay(std::chrono::milliseconds delay) { delay_ = delay; }
  int connections() const { return connections_; }  // accepted so far

 private:
  using Clock = std::chrono::steady_clock;
  struct Direction {
    int to = -1;
    std::string waiting;
    Clock::time_point due;
  };

  void Run();
  void Accept();
  void Forward(int from, Direction& direction);
  void Close(int fd);
  void CloseAll();

  std::string server_ip_;
  int server_port_ = 0;
  int listener_ = -1;
  std::string address_;
  std::map<int, Direction> directions_;  // by the socket that is read; only the thread
  std::atomic<bool> stop_ = false, stalled_ = false, cut_ = false;
  std::atomic<std::chrono::milliseconds> delay_{std::chrono::milliseconds(0)};
  std::atomic<Clock::time_point> refuse_until_{Clock::time_point{}};
  std::atomic<int> connections_ = 0;
  std::thread thread_;
};

}  // namespace romap::testing_support
