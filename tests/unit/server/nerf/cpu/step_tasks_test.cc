#include "server/nerf/cpu/step_tasks.h"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>
#include <vector>

namespace romap::nerf::step_tasks_test {

TEST(StepTasksTest, ReturnsEveryTaskInOrder) {
  StepTasks tasks(2, {2, 3});
  std::vector<std::array<uint64_t, 3> > seen;
  while (const std::optional<StepTasks::Task> task = tasks.Next()) {
    seen.push_back({task->step, static_cast<uint64_t>(task->phase), task->index});
    tasks.Finish();
  }
  const std::vector<std::array<uint64_t, 3> > wanted = {{0, 0, 0}, {0, 0, 1}, {0, 1, 0}, {0, 1, 1}, {0, 1, 2},
                                                        {1, 0, 0}, {1, 0, 1}, {1, 1, 0}, {1, 1, 1}, {1, 1, 2}};
  EXPECT_EQ(seen, wanted);
}

TEST(StepTasksTest, HasNoTasksWithoutSteps) { EXPECT_FALSE(StepTasks(0, {1, 1}).Next()); }

// Each task must read all values that the tasks of the previous phase wrote. The values are plain integers, so that the
// thread sanitizer also reports missing synchronization.
TEST(StepTasksTest, PhasesDoNotOverlap) {
  constexpr uint64_t kSteps = 200, kShares = 3;
  for (const int threads : {1, 2, 4}) {
    StepTasks tasks(kSteps, {kShares, 2});
    std::array<uint64_t, kShares> rendered = {};
    std::array<uint64_t, 2> optimized = {};
    std::atomic<int> faults = 0;
    const auto work = [&] {
      while (const std::optional<StepTasks::Task> task = tasks.Next()) {
        if (task->phase == 0) {
          for (const uint64_t steps : optimized) faults += steps != task->step;
          ++rendered[task->index];
        } else {
          for (const uint64_t steps : rendered) faults += steps != task->step + 1;
          ++optimized[task->index];
        }
        tasks.Finish();
      }
    };
    {
      std::vector<std::jthread> helpers;
      for (int t = 1; t < threads; ++t) helpers.emplace_back(work);
      work();
    }
    EXPECT_EQ(faults, 0) << "threads " << threads;
    for (const uint64_t steps : rendered) EXPECT_EQ(steps, kSteps);
    for (const uint64_t steps : optimized) EXPECT_EQ(steps, kSteps);
  }
}

TEST(StepTasksTest, APhaseWaitsForAllTasksOfThePreviousOne) {
  StepTasks tasks(1, {2, 1});
  ASSERT_TRUE(tasks.Next());
  ASSERT_TRUE(tasks.Next());
  std::atomic<bool> first_phase_finished = false;
  bool finished_before = false;
  int phase = -1;
  std::jthread other([&] {
    const std::optional<StepTasks::Task> task = tasks.Next();
    finished_before = first_phase_finished;
    if (task) phase = task->phase;
    tasks.Finish();
  });
  tasks.Finish();
  first_phase_finished = true;
  tasks.Finish();
  other.join();
  EXPECT_EQ(phase, 1);
  EXPECT_TRUE(finished_before);
  EXPECT_FALSE(tasks.Next());
}

}  // namespace romap::nerf::step_tasks_test
