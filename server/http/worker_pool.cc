#include "server/http/worker_pool.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

#include "common/thread_priority.h"

namespace romap::http {

WorkerPool::WorkerPool(int threads, size_t max_waiting) : max_waiting_(max_waiting) {
  try {
    for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { Run(); });
  } catch (...) {  // the process has no more threads
    Stop();
    throw;
  }
}

bool WorkerPool::Submit(std::function<void()> job) {
  std::lock_guard lock(mutex_);
  if (stopping_ || jobs_.size() >= max_waiting_) return false;
  jobs_.push_back(std::move(job));
  changed_.notify_one();
  return true;
}

void WorkerPool::Dispose(std::function<void()> job) {
  {
    std::lock_guard lock(mutex_);
    if (!stopping_) {
      disposals_.push_back(std::move(job));
      changed_.notify_one();
      return;
    }
  }
  job();
}

void WorkerPool::Stop() {
  {
    std::lock_guard lock(mutex_);
    stopping_ = true;
    changed_.notify_all();
  }
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

void WorkerPool::Run() {
  LowerThreadPriority(kLocalAdjustmentNice);
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return stopping_ || !jobs_.empty() || !disposals_.empty(); });
    std::deque<std::function<void()>>& queue = disposals_.empty() ? jobs_ : disposals_;
    if (queue.empty()) return;  // stopping
    {
      const std::function<void()> job = std::move(queue.front());
      queue.pop_front();
      lock.unlock();
      try {
        job();
      } catch (const std::exception& e) {
        spdlog::error("http: a call failed: {}", e.what());
      }
    }
    lock.lock();
  }
}

}  // namespace romap::http
