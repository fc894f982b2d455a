#include "server/process/service_manager.h"

#include <systemd/sd-daemon.h>

#include <cstdint>
#include <utility>

namespace romap::process {

ServiceManager::ServiceManager(std::function<void()> check) : check_(std::move(check)) {
  uint64_t timeout_us = 0;
  if (sd_watchdog_enabled(/*unset_environment=*/0, &timeout_us) > 0) {
    thread_ = std::thread([this, timeout_us] { AnswerWatchdog(std::chrono::microseconds(timeout_us / 2)); });
  }
  sd_notify(/*unset_environment=*/0, "READY=1");
}

ServiceManager::~ServiceManager() {
  sd_notify(/*unset_environment=*/0, "STOPPING=1");
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
    stopping_changed_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

void ServiceManager::AnswerWatchdog(std::chrono::microseconds period) {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    check_();
    sd_notify(/*unset_environment=*/0, "WATCHDOG=1");
    lock.lock();
    stopping_changed_.wait_for(lock, period, [this] { return stopping_; });
  }
}

}  // namespace romap::process
