#include "server/nerf/training_policy.h"

#include <gtest/gtest.h>

#include <chrono>

namespace romap::nerf::training_policy_test {

using std::chrono::milliseconds;
using std::chrono::seconds;

struct TrainingPolicyTest : public ::testing::Test {
  TrainingPolicyTest() {
    config.min_views = 3;
    config.full_budget_steps = 40;
    config.completion_delay_s = 1;
    config.max_training_time_s = 2;
    config.max_training_time_per_view_s = 0.5;
    config.snapshot_interval_steps = 10;
    config.snapshot_interval_s = 1;
    job.last_view_time = job.sent_time = now;
    job.views = 5;
    job.allowed_steps = 20;
    job.planned_steps = 40;
  }
  TrainingPolicy Policy(bool uses_clock = true) const { return {config, uses_clock}; }

  NerfConfig config;
  TrainingJob job;
  const TrainingPolicy::Time now = TrainingJob::Clock::now();
};

TEST_F(TrainingPolicyTest, AJobIsCompleteIfTheSessionIsFinishedOrNoViewArrivesForAWhile) {
  EXPECT_FALSE(Policy().IsComplete(job, false, now + milliseconds(999)));
  EXPECT_TRUE(Policy().IsComplete(job, false, now + seconds(1)));
  EXPECT_TRUE(Policy().IsComplete(job, true, now));
  EXPECT_EQ(Policy().CompletionTime(job), now + seconds(1));
  EXPECT_FALSE(Policy(false).IsComplete(job, false, now + seconds(100))) << "without workers, time has no effect";
  job.views = 2;
  EXPECT_FALSE(Policy().IsComplete(job, false, now + seconds(1))) << "too few views";
  EXPECT_FALSE(Policy().CompletionTime(job));
}

TEST_F(TrainingPolicyTest, AJobIsRunnableWhileItHasStepsLeftOrUpdates) {
  EXPECT_TRUE(Policy().IsRunnable(job, false, now));
  job.steps = 20;
  EXPECT_FALSE(Policy().IsRunnable(job, false, now));
  EXPECT_TRUE(Policy().IsRunnable(job, true, now)) << "complete jobs are trained to the end of the plan";
  job.steps = 40;
  EXPECT_FALSE(Policy().IsRunnable(job, true, now));
  EXPECT_FALSE(Policy().CompletionTime(job)) << "no steps left";
  EXPECT_TRUE(Policy().IsIdle(job, true));
  job.pending_updates.emplace_back();
  EXPECT_TRUE(Policy().IsRunnable(job, true, now));
  EXPECT_FALSE(Policy().IsIdle(job, true));
  job.leased = true;
  EXPECT_FALSE(Policy().IsRunnable(job, true, now));
}

TEST_F(TrainingPolicyTest, ObjectsWithTooFewViewsAreIdleUntilTheSessionIsFinished) {
  job.views = 2;
  EXPECT_TRUE(Policy().IsIdle(job, false));
  EXPECT_FALSE(Policy().IsIdle(job, true));
}

TEST_F(TrainingPolicyTest, UrgencyPrefersUnfinishedPlansThenFastDecreases) {
  job.steps = 10;
  TrainingJob further, fast, slow;
  further.steps = 30;
  fast.steps = slow.steps = 60;
  further.planned_steps = 40;
  fast.planned_steps = slow.planned_steps = 100;
  fast.loss_decrease = 0.5;
  slow.loss_decrease = 0.1;
  EXPECT_LT(Policy().Urgency(job), Policy().Urgency(further));
  EXPECT_LT(Policy().Urgency(further), Policy().Urgency(fast));
  EXPECT_LT(Policy().Urgency(fast), Policy().Urgency(slow));
}

TEST_F(TrainingPolicyTest, TrainingTimeIsLimitedPerObjectAndView) {
  EXPECT_TRUE(Policy().HasTimeLeft(2.9, 2));
  EXPECT_FALSE(Policy().HasTimeLeft(3.0, 2));
  EXPECT_TRUE(Policy(false).HasTimeLeft(1000, 2));
}

TEST_F(TrainingPolicyTest, SnapshotsAreSentByStepsByTimeAndAtTheEnd) {
  EXPECT_FALSE(Policy().ShouldSend(job, true, now)) << "no steps";
  job.steps = 14;
  job.sent_steps = 5;
  EXPECT_FALSE(Policy().ShouldSend(job, false, now));
  EXPECT_TRUE(Policy().ShouldSend(job, true, now)) << "no later slice";
  EXPECT_TRUE(Policy().ShouldSend(job, false, now + seconds(1)));
  EXPECT_FALSE(Policy(false).ShouldSend(job, false, now + seconds(100)));
  job.steps = 15;
  EXPECT_TRUE(Policy().ShouldSend(job, false, now));
  job.sent_steps = 15;
  EXPECT_FALSE(Policy().ShouldSend(job, true, now)) << "sent before";
}

TEST_F(TrainingPolicyTest, ProgressIsTheShareOfThePlannedSteps) {
  EXPECT_EQ(Policy().Progress(job), 0);
  job.steps = 10;
  EXPECT_DOUBLE_EQ(Policy().Progress(job), 0.25);
  job.planned_steps = 10;  // out of time
  EXPECT_EQ(Policy().Progress(job), 1);
}

}  // namespace romap::nerf::training_policy_test
