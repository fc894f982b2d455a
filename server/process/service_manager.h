#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace romap::process {

// Tells systemd that the process serves, while this object exists, and answers its watchdog (sd_notify(3),
// sd_watchdog_enabled(3)). Does nothing if the process was not started by systemd.
class ServiceManager {
 public:
  // `check` must return while the process works. It is called on a thread of its own, twice in each period of the
  // watchdog: if it blocks, systemd restarts the process.
  explicit ServiceManager(std::function<void()> check);
  // Says that the process is stopping.
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

 private:
  void AnswerWatchdog(std::chrono::microseconds period);

  const std::function<void()> check_;
  std::mutex mutex_;
  std::condition_variable stopping_changed_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace romap::process
