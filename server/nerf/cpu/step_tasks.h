#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

namespace romap::nerf {

// Distributes the tasks of training steps to threads. A step has two phases; a phase starts when all tasks of the
// previous one are finished. Tasks go in order to the next free thread, so a thread that wakes up late on a busy
// machine does not delay the step: other threads run its tasks. Results do not depend on the assignment as long as each
// task has its own memory. Waiting threads sleep.
class StepTasks {
 public:
  struct Task {
    uint64_t step;   // 0..steps - 1
    int phase;       // 0 or 1
    uint64_t index;  // within the phase
  };

  // `tasks`: number of tasks of each phase, at least one.
  StepTasks(uint64_t steps, std::array<uint64_t, 2> tasks) : steps_(steps), tasks_(tasks) {}

  // Waits for the next task; nullopt if all tasks have been assigned. Finish() must follow each task.
  std::optional<Task> Next() {
    for (;;) {
      const uint64_t phase = phase_.load(std::memory_order_acquire);
      if (phase >= 2 * steps_) return std::nullopt;
      uint64_t next = started_.load(std::memory_order_relaxed);
      while (next < EndOf(phase)) {
        if (!started_.compare_exchange_weak(next, next + 1, std::memory_order_relaxed)) continue;
        return Task{phase / 2, static_cast<int>(phase % 2), next + tasks_[phase % 2] - EndOf(phase)};
      }
      phase_.wait(phase, std::memory_order_acquire);
    }
  }

  // Reports that a task is finished. Its writes are visible to all tasks of later phases.
  void Finish() {
    const uint64_t done = done_.fetch_add(1, std::memory_order_acq_rel) + 1;
    const uint64_t phase =
        phase_.load(std::memory_order_relaxed);  // the task's phase, which cannot end before this task does
    if (done != EndOf(phase)) return;
    phase_.store(phase + 1, std::memory_order_release);
    phase_.notify_all();
  }

 private:
  // Number of tasks up to and including a phase.
  uint64_t EndOf(uint64_t phase) const {
    return (phase + 1) / 2 * (tasks_[0] + tasks_[1]) + (1 - phase % 2) * tasks_[0];
  }

  const uint64_t steps_;
  const std::array<uint64_t, 2> tasks_;
  // Counted over all steps.
  std::atomic<uint64_t> phase_ = 0;
  std::atomic<uint64_t> started_ = 0;
  std::atomic<uint64_t> done_ = 0;
};

}  // namespace romap::nerf
