#pragma once

#include <chrono>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

struct event;
struct event_base;

namespace romap::http {

// A libevent loop on a thread of its own.
class EventLoop {
 public:
  // Throws std::bad_alloc if libevent cannot be set up.
  EventLoop();
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  event_base* base() const { return base_; }

  // Starts the thread. Before, everything may be used on the calling thread.
  void Start();
  // Runs `task` on the loop's thread, in the order of the calls. Thread-safe.
  void Post(std::function<void()> task);
  // Runs `task` on the loop's thread and waits for it. Not on that thread.
  void Call(std::function<void()> task);
  // Runs `task` periodically. Before Start().
  void Every(std::chrono::milliseconds period, std::function<void()> task);
  // Ends the thread after the tasks that were posted before.
  void Stop();

 private:
  struct Timer {
    event* timer_event = nullptr;
    std::function<void()> task;
  };

  void RunPosted();

  event_base* base_ = nullptr;
  event* wake_ = nullptr;
  std::list<Timer> timers_;
  std::mutex mutex_;
  std::vector<std::function<void()>> posted_;
  std::thread thread_;
};

}  // namespace romap::http
