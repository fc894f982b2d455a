#include "server/nerf/training_pool.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <map>
#include <mutex>
#include <thread>

#include "common/map_motion.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::training_pool_test {

using testing_support::BallScene;

NerfConfig TinyConfig() {
  NerfConfig config;
  config.levels = 4;
  config.log2_table_entries = 10;
  config.finest_resolution = 64;
  config.hidden_width = 16;
  config.rays_per_step = 128;
  config.first_budget_steps = 10;
  config.budget_steps_per_view = 2;
  config.full_budget_steps = 40;
  config.slice_steps = 5;
  config.snapshot_interval_steps = 10;
  config.completion_delay_s = 3600;
  config.max_extra_steps = 0;
  return config;
}

ObjectViews MakeUpdate(uint64_t object, int views) {
  BallScene scene;
  scene.object = ObjectId{object};
  scene.views = views;
  scene.size_px = 32;
  return {.object = scene.object, .cuboid = scene.Box(), .new_views = scene.Views()};
}

// Stores the snapshots that a session receives.
struct Inbox {
  std::mutex mutex;
  std::map<ObjectId, std::vector<FieldSnapshot>> snapshots;

  TrainingPool::Sink Sink() {
    return [this](FieldSnapshot snapshot) {
      std::lock_guard lock(mutex);
      snapshots[snapshot.object].push_back(std::move(snapshot));
    };
  }
  std::vector<FieldSnapshot> Of(uint64_t object) {
    std::lock_guard lock(mutex);
    return snapshots[ObjectId{object}];
  }
};

// Fails the test after a minute.
template <class Condition>
void WaitFor(const char* what, Condition&& condition) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) FAIL() << "timed out waiting for " << what;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

void WaitUntilIdle(const TrainingPool& pool, TrainingPool::SessionId session) {
  WaitFor("the pool to become idle", [&] { return pool.IsIdle(session); });
}

TEST(TrainingPoolTest, FinishTrainsEveryObjectToTheEndOfItsPlan) {
  Inbox inbox;
  TrainingPool pool(TinyConfig(), 2);
  const TrainingPool::SessionId session = pool.AddSession(inbox.Sink());
  for (uint64_t object = 1; object <= 3; ++object) pool.Offer(session, MakeUpdate(object, 5));
  pool.Finish(session);
  WaitUntilIdle(pool, session);
  const TrainingPool::Progress progress = pool.GetProgress(session);
  EXPECT_EQ(progress.objects_total, 3);
  EXPECT_EQ(progress.objects_training, 0);
  EXPECT_EQ(progress.steps, 120u);
  EXPECT_EQ(progress.progress, 1.0);
  pool.RemoveSession(session);
  for (uint64_t object = 1; object <= 3; ++object) {
    const std::vector<FieldSnapshot> snapshots = inbox.Of(object);
    ASSERT_FALSE(snapshots.empty());
    for (size_t i = 0; i + 1 < snapshots.size(); ++i) {
      EXPECT_LT(snapshots[i].steps, snapshots[i + 1].steps);
      EXPECT_FALSE(snapshots[i].converged);
    }
    EXPECT_TRUE(snapshots.back().converged);
    EXPECT_EQ(snapshots.back().steps, 40u);
    EXPECT_EQ(snapshots.back().views, 5);
  }
}

TEST(TrainingPoolTest, BudgetGrowsWithViews) {
  Inbox inbox;
  TrainingPool pool(TinyConfig(), 1);
  const TrainingPool::SessionId session = pool.AddSession(inbox.Sink());
  pool.Offer(session, MakeUpdate(1, 2));
  WaitUntilIdle(pool, session);
  EXPECT_EQ(pool.GetProgress(session).steps, 0u);  // too few views
  pool.Offer(session, MakeUpdate(1, 5));
  WaitFor("the budget of five views", [&] { return !inbox.Of(1).empty() && inbox.Of(1).back().steps == 14; });
  EXPECT_FALSE(inbox.Of(1).back().converged);
  pool.Finish(session);
  WaitUntilIdle(pool, session);
  EXPECT_EQ(pool.GetProgress(session).steps, 40u);
}

TEST(TrainingPoolTest, CompletesAnObjectWithoutNewViews) {
  NerfConfig config = TinyConfig();
  config.completion_delay_s = 0.05;
  Inbox inbox;
  TrainingPool pool(config, 1);
  const TrainingPool::SessionId session = pool.AddSession(inbox.Sink());
  pool.Offer(session, MakeUpdate(1, 3));
  WaitFor("convergence", [&] { return !inbox.Of(1).empty() && inbox.Of(1).back().converged; });
  EXPECT_EQ(inbox.Of(1).back().steps, 40u);
}

TEST(TrainingPoolTest, RemoveSessionWaitsForTheSink) {
  std::atomic<bool> removed = false;
  std::atomic<int> arrived = 0, late = 0;
  NerfConfig config = TinyConfig();
  config.full_budget_steps = 100000;
  config.snapshot_interval_steps = 1;
  {
    TrainingPool pool(config, 2);
    const TrainingPool::SessionId session = pool.AddSession([&](FieldSnapshot) {
      if (removed) ++late;
      ++arrived;
    });
    pool.Offer(session, MakeUpdate(1, 4));
    pool.Offer(session, MakeUpdate(2, 4));
    pool.Finish(session);
    WaitFor("snapshots", [&] { return arrived > 2; });
    pool.RemoveSession(session);
    removed = true;
    EXPECT_TRUE(pool.IsIdle(session));
    pool.Offer(session, MakeUpdate(3, 4));  // ignored
    EXPECT_EQ(pool.GetProgress(session).objects_total, 0);
  }  // joins the workers
  EXPECT_EQ(late, 0);
}

TEST(TrainingPoolTest, RemovedObjectsAreNotTrained) {
  Inbox inbox;
  TrainingPool pool(TinyConfig(), 1);
  const TrainingPool::SessionId session = pool.AddSession(inbox.Sink());
  pool.Offer(session, MakeUpdate(1, 4));
  pool.Offer(session, MakeUpdate(2, 4));
  pool.RemoveObject(session, ObjectId{1});
  pool.Finish(session);
  WaitUntilIdle(pool, session);
  EXPECT_EQ(pool.GetProgress(session).objects_total, 1);
  EXPECT_TRUE(inbox.Of(2).back().converged);
}

TEST(TrainingPoolTest, RejectsOnlyTheInvalidViewsOfAnUpdate) {
  Inbox inbox;
  TrainingPool pool(TinyConfig(), 1);
  const TrainingPool::SessionId session = pool.AddSession(inbox.Sink());
  ObjectViews offer = MakeUpdate(1, 5);
  offer.new_views[1].ray_kind = cv::Mat();
  offer.new_views[2].T_world_camera = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, NAN)};
  pool.Offer(session, offer);
  pool.Finish(session);
  WaitUntilIdle(pool, session);
  ASSERT_FALSE(inbox.Of(1).empty());
  EXPECT_EQ(inbox.Of(1).back().views, 3);
}

TEST(TrainingPoolTest, AMovedObjectIsNeitherTrainedNorSentAgain) {
  Inbox inbox;
  TrainingPool pool(TinyConfig(), 1);
  const TrainingPool::SessionId session = pool.AddSession(inbox.Sink());
  ObjectViews offer = MakeUpdate(1, 5);
  pool.Offer(session, offer);
  pool.Finish(session);
  WaitUntilIdle(pool, session);
  const size_t sent = inbox.Of(1).size();

  const Sim3<World, World> S(1.3, Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ())), {1, 2, 3});
  const ObjectViews moved{.object = ObjectId{1}, .S_new_old = S, .cuboid = Moved(S, offer.cuboid)};
  pool.Offer(session, moved);
  WaitUntilIdle(pool, session);
  EXPECT_EQ(pool.GetProgress(session).steps, 40u);
  EXPECT_EQ(inbox.Of(1).size(), sent);

  // A view that moved relative to the object adds some steps, in the corrected world.
  ObjectViews corrected{.object = ObjectId{1}, .cuboid = moved.cuboid};
  const SE3<Camera, Camera> small(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.01, 0, 0));
  corrected.corrected_views = {{KeyframeId{2}, S.Moved(offer.new_views[1].T_world_camera) * small}};
  pool.Offer(session, corrected);
  WaitUntilIdle(pool, session);
  EXPECT_GT(pool.GetProgress(session).steps, 40u);
  ASSERT_GT(inbox.Of(1).size(), sent);
  const FieldSnapshot last = inbox.Of(1).back();
  EXPECT_TRUE(last.converged);
  EXPECT_EQ(last.views, 5);
  EXPECT_NEAR(last.S_new_first.scale(), 1.3, 1e-9);
  EXPECT_TRUE(last.T_world_object.translation().isApprox(S * offer.cuboid.T_world_object.translation(), 1e-9));
}

TEST(TrainingPoolTest, SnapshotsCarryTheWarningsOfTheirObject) {
  Inbox inbox;
  TrainingPool pool(TinyConfig(), 1);
  const TrainingPool::SessionId session = pool.AddSession(inbox.Sink());
  pool.Offer(session, MakeUpdate(1, 4));
  ObjectViews invalid = MakeUpdate(2, 4);
  invalid.cuboid.half_extents.z() = NAN;
  pool.Offer(session, invalid);
  pool.Offer(session, MakeUpdate(2, 5));
  pool.Finish(session);
  WaitUntilIdle(pool, session);
  EXPECT_THAT(inbox.Of(2).back().warning, ::testing::HasSubstr("4 views rejected"));
  EXPECT_EQ(inbox.Of(1).back().warning, "");
  EXPECT_EQ(inbox.Of(1).back().steps, 40u) << "other objects are trained as usual";
}

TEST(TrainingPoolTest, TrainingTimeIsLimitedOnlyWithWorkers) {
  NerfConfig config = TinyConfig();
  config.full_budget_steps = 100000;
  config.max_training_time_s = 0.02;
  config.max_training_time_per_view_s = 0.002;
  {
    Inbox inbox;
    TrainingPool pool(config, 1);
    const TrainingPool::SessionId session = pool.AddSession(inbox.Sink());
    pool.Offer(session, MakeUpdate(1, 5));
    pool.Finish(session);
    WaitUntilIdle(pool, session);
    const uint64_t steps = pool.GetProgress(session).steps;
    EXPECT_GT(steps, 0u);
    EXPECT_LT(steps, 100000u);
    EXPECT_TRUE(inbox.Of(1).back().converged);
    EXPECT_EQ(pool.GetProgress(session).progress, 1.0);
  }
  config.full_budget_steps = 200;
  config.max_training_time_s = config.max_training_time_per_view_s = 0;
  TrainingPool pool(config, 0);
  const TrainingPool::SessionId session = pool.AddSession([](FieldSnapshot) {});
  pool.Offer(session, MakeUpdate(1, 5));
  pool.Finish(session);
  pool.TrainSlices(session, 1000);
  EXPECT_EQ(pool.GetProgress(session).steps, 200u);
}

TEST(TrainingPoolTest, StepsBeyondThePlanGoToTheObjectWhoseLossDecreasesFastest) {
  NerfConfig config = TinyConfig();
  config.probe_interval_steps = 10;
  config.max_extra_steps = 100000;
  config.min_loss_decrease = 0;
  ObjectViews colored = MakeUpdate(1, 5), black = MakeUpdate(2, 5);
  for (ObjectView& view : black.new_views) view.color_bgr = cv::Mat::zeros(view.color_bgr.size(), CV_8UC3);
  Inbox inbox;
  TrainingPool pool(config, 0);
  const TrainingPool::SessionId session = pool.AddSession(inbox.Sink());
  pool.Offer(session, colored);
  pool.Offer(session, black);
  pool.Finish(session);
  pool.TrainSlices(session, 16);  // both plans
  const uint64_t first = inbox.Of(1).back().steps, second = inbox.Of(2).back().steps;
  EXPECT_EQ(first, 40u);
  EXPECT_EQ(second, 40u);
  ObjectField field(config, ObjectId{1}, 1), black_field(config, ObjectId{2}, 2);
  const auto loss_decrease = [](ObjectField& f, const ObjectViews& offer) {
    EXPECT_TRUE(f.SetBox(offer.cuboid).ok());
    for (const ObjectView& view : offer.new_views) EXPECT_TRUE(f.AddView(view).ok());
    for (int i = 0; i < 8; ++i) f.Train(5, 1);
    return f.LossDecrease().value();
  };
  const double decreases[] = {loss_decrease(field, colored), loss_decrease(black_field, black)};
  ASSERT_GT(std::abs(decreases[0] - decreases[1]), 0.01);
  const uint64_t better = decreases[0] > decreases[1] ? 1 : 2;
  pool.TrainSlices(session, 2);
  EXPECT_EQ(inbox.Of(better).back().steps, 50u);
  EXPECT_EQ(inbox.Of(3 - better).back().steps, 40u);
}

TEST(TrainingPoolTest, DivergedFieldsAreNotSent) {
  NerfConfig config = TinyConfig();
  config.learning_rate = config.final_learning_rate = 1e30;  // overflows in the first step
  Inbox inbox;
  TrainingPool pool(config, 1);
  const TrainingPool::SessionId session = pool.AddSession(inbox.Sink());
  pool.Offer(session, MakeUpdate(1, 4));
  pool.Finish(session);
  WaitUntilIdle(pool, session);  // training pauses after some attempts
  pool.RemoveSession(session);
  EXPECT_TRUE(inbox.Of(1).empty());
}

TEST(TrainingPoolTest, WithoutWorkersTrainingIsDeterministic) {
  const auto train = [](std::vector<uint64_t>* steps_seen) {
    NerfConfig config = TinyConfig();
    config.completion_delay_s = 0;  // nothing may depend on time
    config.snapshot_interval_s = 0;
    Inbox inbox;
    TrainingPool pool(config, 0);
    const TrainingPool::SessionId session = pool.AddSession(inbox.Sink());
    const TrainingPool::SessionId other = pool.AddSession([](FieldSnapshot) { FAIL() << "trained another session"; });
    pool.Offer(other, MakeUpdate(1, 5));
    pool.Offer(session, MakeUpdate(1, 5));
    pool.Offer(session, MakeUpdate(2, 5));
    EXPECT_EQ(pool.GetProgress(session).steps, 0u);
    pool.TrainSlices(session, 3);
    EXPECT_EQ(pool.GetProgress(session).steps, 15u);
    pool.TrainSlices(session, 1000);
    EXPECT_EQ(pool.GetProgress(session).steps, 28u) << "14 steps each while more views may come";
    pool.Finish(session);
    pool.TrainSlices(session, 1000);
    EXPECT_TRUE(pool.IsIdle(session));
    EXPECT_EQ(pool.GetProgress(session).steps, 80u);

    const std::vector<FieldSnapshot> snapshots = inbox.Of(1);
    for (const FieldSnapshot& snapshot : snapshots) steps_seen->push_back(snapshot.steps);
    std::vector<Eigen::Vector3f> places;
    for (int i = -5; i <= 5; ++i) places.emplace_back(0.02F * static_cast<float>(i), 0.01F, -0.03F);
    std::vector<float> raw(places.size());
    snapshots.back().field->Sample(places, raw, {});
    return raw;
  };
  std::vector<uint64_t> first_steps, second_steps;
  EXPECT_EQ(train(&first_steps), train(&second_steps));
  EXPECT_EQ(first_steps, second_steps);
  EXPECT_EQ(first_steps.back(), 40u);
}

}  // namespace romap::nerf::training_pool_test
