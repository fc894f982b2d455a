#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

namespace romap::nerf {

// Hands out the tasks of training steps to threads. A step has two phases, and a phase begins when all tasks of the one
// before are done. Tasks go to whoever comes first, in their order, so a thread that the system has not woken yet, on
// cores that others use too, holds up nobody: the others do its share. Results do not depend on who does what as long
// as each task has memory of its own. Waiting threads sleep.
class StepTasks {
 public:
  struct Task {
    uint64_t step;   // 0 .. steps - 1
    int phase;       // 0 or 1
    uint64_t index;  // within the phase
  };

  // `tasks`: of each phase, at least one.
  StepTasks(uint64_t steps, std::array<uint64_t, 2> tasks) : steps_(steps), tasks_(tasks) {}

  // The next task, as soon as it may begin; nothing when all steps are handed out or done. Finish() must follow.
  std::optional<Task> Take() {
    for (;;) {
      const uint64_t phase = phase_.load(std::memory_order_acquire);
      if (phase >= 2 * steps_) return std::nullopt;
      uint64_t next = taken_.load(std::memory_order_relaxed);
      while (next < EndOf(phase)) {
        if (!taken_.compare_exchange_weak(next, next + 1, std::memory_order_relaxed)) continue;
        return Task{phase / 2, static_cast<int>(phase % 2), next + tasks_[phase % 2] - EndOf(phase)};
      }
      phase_.wait(phase, std::memory_order_acquire);
    }
  }

  // A task is done. Whoever takes a task of a later phase sees what it has written.
  void Finish() {
    const uint64_t done = done_.fetch_add(1, std::memory_order_acq_rel) + 1;
    const uint64_t phase = phase_.load(std::memory_order_relaxed);  // that of the task: it cannot end without it
    if (done != EndOf(phase)) return;
    phase_.store(phase + 1, std::memory_order_release);
    phase_.notify_all();
  }

 private:
  // Number of tasks up to the end of a phase.
  uint64_t EndOf(uint64_t phase) const {
    return (phase + 1) / 2 * (tasks_[0] + tasks_[1]) + (1 - phase % 2) * tasks_[0];
  }

  const uint64_t steps_;
  const std::array<uint64_t, 2> tasks_;
  // Over all steps.
  std::atomic<uint64_t> phase_ = 0;
  std::atomic<uint64_t> taken_ = 0;
  std::atomic<uint64_t> done_ = 0;
};

}  // namespace romap::nerf
