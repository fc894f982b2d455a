#include "server/nerf/cpu/step_tasks.h"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>
#include <vector>

namespace romap::nerf {
namespace {

TEST(StepTasksTest, HandsOutEveryTaskInOrder) {
  StepTasks tasks(2, {2, 3});
  std::vector<std::array<uint64_t, 3> > seen;
  while (const std::optional<StepTasks::Task> task = tasks.Take()) {
    seen.push_back({task->step, static_cast<uint64_t>(task->phase), task->index});
    tasks.Finish();
  }
  const std::vector<std::array<uint64_t, 3> > wanted = {{0, 0, 0}, {0, 0, 1}, {0, 1, 0}, {0, 1, 1}, {0, 1, 2},
                                                        {1, 0, 0}, {1, 0, 1}, {1, 1, 0}, {1, 1, 1}, {1, 1, 2}};
  EXPECT_EQ(seen, wanted);
}

TEST(StepTasksTest, NoStepsNoTasks) { EXPECT_FALSE(StepTasks(0, {1, 1}).Take()); }

// Each task of a phase must see all that those of the phase before have written. Plain integers, so that the thread
// sanitizer would notice a missing order, too.
TEST(StepTasksTest, PhasesFollowOneAnother) {
  constexpr uint64_t kSteps = 200, kShares = 3;
  for (const int threads : {1, 2, 4}) {
    StepTasks tasks(kSteps, {kShares, 2});
    std::array<uint64_t, kShares> rendered = {};
    std::array<uint64_t, 2> optimized = {};
    std::atomic<int> faults = 0;
    const auto work = [&] {
      while (const std::optional<StepTasks::Task> task = tasks.Take()) {
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

TEST(StepTasksTest, WaitsForATaskAtWorkOnly) {
  StepTasks tasks(1, {2, 1});
  ASSERT_TRUE(tasks.Take());
  ASSERT_TRUE(tasks.Take());
  std::atomic<bool> taken = false;
  std::jthread other([&] {
    const std::optional<StepTasks::Task> task = tasks.Take();
    taken = task && task->phase == 1;
    tasks.Finish();
  });
  tasks.Finish();
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_FALSE(taken);  // the other task of the phase is still at work
  tasks.Finish();
  other.join();
  EXPECT_TRUE(taken);
  EXPECT_FALSE(tasks.Take());
}

}  // namespace
}  // namespace romap::nerf
