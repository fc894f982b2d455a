#include "server/http/event_loop.h"

#include <event2/event.h>
#include <event2/thread.h>
#include <pthread.h>
#include <signal.h>
#include <spdlog/spdlog.h>

#include <exception>
#include <future>
#include <new>
#include <utility>

#include "common/printable.h"

namespace romap::http {
namespace {

// libevent has no locks before this.
void SetUpLibevent() {
  static const bool kDone = [] {
    event_set_log_callback([](int severity, const char* message) {
      if (severity >= EVENT_LOG_ERR) {
        spdlog::error("http: {}", Printable(message));
      } else {
        spdlog::debug("http: {}", Printable(message));
      }
    });
    return evthread_use_pthreads() == 0;
  }();
  if (!kDone) throw std::bad_alloc();
}

// An exception must not pass through libevent.
void RunGuarded(const std::function<void()>& task) {
  try {
    task();
  } catch (const std::exception& e) {
    spdlog::error("http: {}", e.what());
  }
}

}  // namespace

EventLoop::EventLoop() {
  SetUpLibevent();
  base_ = event_base_new();
  if (base_ == nullptr) throw std::bad_alloc();
  wake_ = event_new(
      base_, -1, EV_PERSIST, [](evutil_socket_t, short, void* self) { static_cast<EventLoop*>(self)->RunPosted(); },
      this);
  if (wake_ == nullptr || event_add(wake_, nullptr) != 0) throw std::bad_alloc();
}

EventLoop::~EventLoop() {
  Stop();
  for (const Timer& timer : timers_) event_free(timer.timer_event);
  posted_.clear();
  event_base_loop(base_, EVLOOP_NONBLOCK);  // connections that were freed last are freed by an event of their own
  event_free(wake_);
  event_base_free(base_);
}

void EventLoop::Start() {
  thread_ = std::thread([this] {
    // libevent writes to connections that the peer may have closed. The signal goes to the thread that writes.
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    event_base_loop(base_, EVLOOP_NO_EXIT_ON_EMPTY);
  });
}

void EventLoop::Post(std::function<void()> task) {
  {
    std::lock_guard lock(mutex_);
    posted_.push_back(std::move(task));
  }
  event_active(wake_, EV_READ, 0);
}

void EventLoop::Call(std::function<void()> task) {
  std::promise<void> done;
  Post([&] {
    task();
    done.set_value();
  });
  done.get_future().wait();
}

void EventLoop::Every(std::chrono::milliseconds period, std::function<void()> task) {
  Timer& timer = timers_.emplace_back();
  timer.task = std::move(task);
  timer.timer_event = event_new(
      base_, -1, EV_PERSIST, [](evutil_socket_t, short, void* self) { RunGuarded(static_cast<Timer*>(self)->task); },
      &timer);
  const timeval interval{.tv_sec = period.count() / 1000, .tv_usec = 1000 * (period.count() % 1000)};
  if (timer.timer_event == nullptr || event_add(timer.timer_event, &interval) != 0) throw std::bad_alloc();
}

void EventLoop::Stop() {
  if (!thread_.joinable()) return;
  Post([this] { event_base_loopbreak(base_); });
  thread_.join();
}

void EventLoop::RunPosted() {
  std::vector<std::function<void()>> tasks;
  {
    std::lock_guard lock(mutex_);
    tasks.swap(posted_);
  }
  for (const auto& task : tasks) RunGuarded(task);
}

}  // namespace romap::http
