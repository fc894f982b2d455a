#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace romap::http {

// A few threads for calls that may block. They have a low priority. Thread-safe.
class WorkerPool {
 public:
  // `max_waiting`: jobs of Submit() that may wait for a thread.
  WorkerPool(int threads, size_t max_waiting);
  ~WorkerPool() { Stop(); }

  // False: too many jobs wait, or the pool was stopped; the job is dropped.
  bool Submit(std::function<void()> job);
  // Runs a job that ends something, even if many wait. After Stop(), on the calling thread.
  void Dispose(std::function<void()> job);
  // Runs the jobs that wait and ends the threads.
  void Stop();

 private:
  void Run();

  const size_t max_waiting_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> jobs_, disposals_;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace romap::http
