#pragma once

#include <pthread.h>

#include <chrono>
#include <list>
#include <mutex>
#include <optional>
#include <string>

namespace romap::session {

// A stage that does not end.
struct StageHang {
  std::string stage;
  double since_s = 0;  // how long it has run
  std::string stack;   // return addresses of its thread, the innermost first
};

// Knows which stages run now, and on which threads. Thread-safe.
class StageWatch {
 public:
  using Clock = std::chrono::steady_clock;

 private:
  struct Running {
    const char* stage;
    pthread_t thread;
    Clock::time_point since;
    std::optional<Clock::time_point> overdue_since = {};  // when FindHang() saw it first
  };

 public:
  // The current thread is in a stage while this object exists.
  class Scope {
   public:
    Scope(StageWatch* watch, const char* stage);
    ~Scope();
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    StageWatch* const watch_;
    std::list<Running>::iterator entry_;
  };

  // The stage that began last among those that run longer than `limit`: the others may wait for it. Only if it still
  // runs `confirmation` after an earlier call saw it so: a process that was suspended for a long time does not hang.
  std::optional<StageHang> FindHang(std::chrono::duration<double> limit,
                                    std::chrono::duration<double> confirmation = std::chrono::seconds(0));

 private:
  std::mutex mutex_;
  std::list<Running> running_;
};

}  // namespace romap::session
