#include "server/nerf/training_queue.h"

#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <vector>

namespace romap::nerf::training_queue_test {

ObjectViews UpdateOf(uint64_t object) { return {.object = ObjectId{object}, .cuboid = {}}; }

struct TrainingQueueTest : public ::testing::Test {
  std::optional<TrainingQueue::Lease> Next() { return queue.Next(TrainingJob::Clock::now()); }
  // Leases a job and returns it with steps left, as after a slice.
  std::optional<ObjectId> RunSlice(const std::map<uint64_t, double>& cost_s = {}) {
    std::optional<TrainingQueue::Lease> lease = Next();
    if (!lease) return std::nullopt;
    lease->job->planned_steps = 1000;
    lease->job->steps += 10;
    const auto cost = cost_s.find(lease->job->object.value);
    queue.Return(*lease, cost != cost_s.end() ? cost->second : 0.1);
    return lease->job->object;
  }

  TrainingQueue queue{NerfConfig(), 4};
  const TrainingSessionId session = queue.AddSession([](FieldSnapshot) {});
};

TEST_F(TrainingQueueTest, ALeaseTakesAllUpdatesOfOneJob) {
  EXPECT_FALSE(Next());
  queue.AddUpdate(session, UpdateOf(1));
  queue.AddUpdate(session, UpdateOf(1));
  std::optional<TrainingQueue::Lease> lease = Next();
  ASSERT_TRUE(lease);
  EXPECT_EQ(lease->job->object, ObjectId{1});
  EXPECT_EQ(lease->updates.size(), 2u);
  queue.AddUpdate(session, UpdateOf(1));
  EXPECT_FALSE(Next()) << "the job is leased";
  EXPECT_FALSE(queue.IsIdle(session));
  queue.Return(*lease, 0.1);
  lease = Next();
  ASSERT_TRUE(lease);
  EXPECT_EQ(lease->updates.size(), 1u);
}

TEST_F(TrainingQueueTest, SessionsTakeTurns) {
  const TrainingSessionId other = queue.AddSession([](FieldSnapshot) {});
  for (uint64_t object = 1; object <= 4; ++object) queue.AddUpdate(session, UpdateOf(object));
  queue.AddUpdate(other, UpdateOf(9));
  queue.FindSession(session)->finished = queue.FindSession(other)->finished = true;
  int of_other = 0;
  for (int slice = 0; slice < 20; ++slice) of_other += RunSlice() == ObjectId{9} ? 1 : 0;
  EXPECT_EQ(of_other, 10);
}

TEST_F(TrainingQueueTest, SessionsGetEqualTimeWhateverTheirSlicesCost) {
  const TrainingSessionId other = queue.AddSession([](FieldSnapshot) {});
  queue.AddUpdate(session, UpdateOf(1));
  queue.AddUpdate(other, UpdateOf(9));
  queue.FindSession(session)->finished = queue.FindSession(other)->finished = true;
  int of_other = 0;
  for (int slice = 0; slice < 50; ++slice) of_other += RunSlice({{1, 0.4}, {9, 0.1}}) == ObjectId{9} ? 1 : 0;
  EXPECT_EQ(of_other, 40);
}

TEST_F(TrainingQueueTest, TenantsGetEqualTimeWhateverTheirNumberOfSessions) {
  const TrainingSessionId small = queue.AddSession([](FieldSnapshot) {}, {.tenant = "small"});
  queue.AddUpdate(small, UpdateOf(9));
  queue.FindSession(small)->finished = true;
  for (uint64_t object = 1; object <= 3; ++object) {
    const TrainingSessionId large = queue.AddSession([](FieldSnapshot) {}, {.tenant = "large"});
    queue.AddUpdate(large, UpdateOf(object));
    queue.FindSession(large)->finished = true;
  }
  std::map<uint64_t, int> slices;
  for (int slice = 0; slice < 60; ++slice) ++slices[RunSlice()->value];
  EXPECT_EQ(slices, (std::map<uint64_t, int>{{1, 10}, {2, 10}, {3, 10}, {9, 30}}));
}

TEST_F(TrainingQueueTest, TimeInWhichASessionHadNoWorkIsNotSavedUp) {
  const TrainingSessionId late = queue.AddSession([](FieldSnapshot) {});
  queue.AddUpdate(session, UpdateOf(1));
  queue.FindSession(session)->finished = queue.FindSession(late)->finished = true;
  for (int slice = 0; slice < 40; ++slice) RunSlice();
  queue.AddUpdate(late, UpdateOf(9));
  int of_late = 0;
  for (int slice = 0; slice < 20; ++slice) of_late += RunSlice() == ObjectId{9} ? 1 : 0;
  EXPECT_LE(of_late, 11);
  EXPECT_GE(of_late, 9);
}

TEST_F(TrainingQueueTest, WithinASessionTheObjectWithTheFewestStepsRunsFirst) {
  queue.FindSession(session)->finished = true;
  for (uint64_t object = 1; object <= 3; ++object) queue.AddUpdate(session, UpdateOf(object));
  std::vector<uint64_t> order;
  for (int slice = 0; slice < 6; ++slice) order.push_back(RunSlice()->value);
  EXPECT_EQ(order, (std::vector<uint64_t>{1, 2, 3, 1, 2, 3}));
}

TEST_F(TrainingQueueTest, FewJobsUseTheThreadsOfIdleWorkers) {
  queue.AddUpdate(session, UpdateOf(1));
  EXPECT_EQ(Next()->threads, 4);
  queue.AddUpdate(session, UpdateOf(2));
  EXPECT_EQ(Next()->threads, 2) << "one job is leased, one is runnable";
}

TEST_F(TrainingQueueTest, RemovedAndAbandonedObjectsAreNotLeased) {
  queue.AddUpdate(session, UpdateOf(1));
  queue.AddUpdate(session, UpdateOf(2));
  EXPECT_TRUE(queue.RemoveObject(session, ObjectId{1})->removed);
  EXPECT_EQ(queue.RemoveObject(session, ObjectId{1}), nullptr);
  const std::optional<TrainingQueue::Lease> lease = Next();
  ASSERT_TRUE(lease);
  EXPECT_EQ(lease->job->object, ObjectId{2});
  queue.Abandon(*lease);
  queue.Return(*lease, 0.1);
  queue.AddUpdate(session, UpdateOf(2));
  EXPECT_FALSE(Next());
  EXPECT_EQ(queue.Progress(session).objects_total, 0);
}

TEST_F(TrainingQueueTest, UnknownAndClosingSessionsHaveNoJobs) {
  queue.AddUpdate(99, UpdateOf(1));
  EXPECT_EQ(queue.FindSession(99), nullptr);
  EXPECT_EQ(queue.ExtractSession(99), nullptr);
  EXPECT_TRUE(queue.IsIdle(99));
  queue.AddUpdate(session, UpdateOf(1));
  queue.FindSession(session)->closing = true;
  EXPECT_FALSE(Next());
  EXPECT_NE(queue.ExtractSession(session), nullptr);
  EXPECT_EQ(queue.FindSession(session), nullptr);
}

}  // namespace romap::nerf::training_queue_test
