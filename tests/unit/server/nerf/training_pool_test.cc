#include "server/nerf/training_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <map>
#include <mutex>
#include <thread>

#include "common/map_motion.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf {
namespace {

using testing::BallScene;

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

ObjectViews Offer(uint64_t object, int views) {
  testing::BallScene scene;
  scene.object = ObjectId{object};
  scene.views = views;
  scene.size_px = 32;
  return {.object = scene.object, .cuboid = scene.Box(), .new_views = scene.Views()};
}

// Keeps what arrives.
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

void WaitUntilIdle(const TrainingPool& pool, uint64_t client) {
  while (!pool.Idle(client)) std::this_thread::sleep_for(std::chrono::milliseconds(2));
}

template <class Condition>
void WaitFor(Condition&& condition) {
  while (!condition()) std::this_thread::sleep_for(std::chrono::milliseconds(2));
}

TEST(TrainingPoolTest, TrainsEveryObjectToTheEndAfterFinish) {
  Inbox inbox;
  TrainingPool pool(TinyConfig(), 2);
  const uint64_t client = pool.Register(inbox.Sink());
  for (uint64_t object = 1; object <= 3; ++object) pool.Offer(client, Offer(object, 5));
  pool.Finish(client);
  WaitUntilIdle(pool, client);
  const TrainingPool::Progress progress = pool.GetProgress(client);
  EXPECT_EQ(progress.objects_total, 3);
  EXPECT_EQ(progress.objects_training, 0);
  EXPECT_EQ(progress.steps, 120u);
  EXPECT_EQ(progress.progress, 1.0);
  pool.Unregister(client);
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
  const uint64_t client = pool.Register(inbox.Sink());
  pool.Offer(client, Offer(1, 2));
  WaitUntilIdle(pool, client);
  EXPECT_EQ(pool.GetProgress(client).steps, 0u);  // too few views
  pool.Offer(client, Offer(1, 5));
  WaitFor([&] { return !inbox.Of(1).empty() && inbox.Of(1).back().steps == 14; });
  EXPECT_FALSE(inbox.Of(1).back().converged);
  pool.Finish(client);
  WaitUntilIdle(pool, client);
  EXPECT_EQ(pool.GetProgress(client).steps, 40u);
}

TEST(TrainingPoolTest, CompletesAnObjectThatGetsNoMoreViews) {
  NerfConfig config = TinyConfig();
  config.completion_delay_s = 0.05;
  Inbox inbox;
  TrainingPool pool(config, 1);
  const uint64_t client = pool.Register(inbox.Sink());
  pool.Offer(client, Offer(1, 3));
  WaitFor([&] { return !inbox.Of(1).empty() && inbox.Of(1).back().converged; });
  EXPECT_EQ(inbox.Of(1).back().steps, 40u);
}

TEST(TrainingPoolTest, NothingArrivesAfterUnregister) {
  std::atomic<bool> unregistered = false, late = false;
  std::atomic<int> arrived = 0;
  NerfConfig config = TinyConfig();
  config.full_budget_steps = 100000;
  config.snapshot_interval_steps = 1;
  TrainingPool pool(config, 2);
  const uint64_t client = pool.Register([&](FieldSnapshot) {
    if (unregistered) late = true;
    ++arrived;
  });
  pool.Offer(client, Offer(1, 4));
  pool.Offer(client, Offer(2, 4));
  pool.Finish(client);
  WaitFor([&] { return arrived > 2; });
  pool.Unregister(client);
  unregistered = true;
  const int at_end = arrived;
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_FALSE(late);
  EXPECT_EQ(arrived, at_end);
  EXPECT_TRUE(pool.Idle(client));
  pool.Offer(client, Offer(3, 4));  // a client that is gone is ignored
  EXPECT_EQ(pool.GetProgress(client).objects_total, 0);
}

TEST(TrainingPoolTest, ClientsTakeTurns) {
  NerfConfig config = TinyConfig();
  config.full_budget_steps = 100000;
  TrainingPool pool(config, 1);
  const uint64_t many = pool.Register([](FieldSnapshot) {});
  const uint64_t one = pool.Register([](FieldSnapshot) {});
  for (uint64_t object = 1; object <= 4; ++object) pool.Offer(many, Offer(object, 4));
  pool.Offer(one, Offer(1, 4));
  pool.Finish(many);
  pool.Finish(one);
  WaitFor([&] { return pool.GetProgress(one).steps >= 100; });
  const double ratio =
      static_cast<double>(pool.GetProgress(many).steps) / static_cast<double>(pool.GetProgress(one).steps);
  EXPECT_GT(ratio, 0.6);
  EXPECT_LT(ratio, 1.8);
}

TEST(TrainingPoolTest, RemovedObjectIsForgotten) {
  Inbox inbox;
  TrainingPool pool(TinyConfig(), 1);
  const uint64_t client = pool.Register(inbox.Sink());
  pool.Offer(client, Offer(1, 4));
  pool.Offer(client, Offer(2, 4));
  pool.Remove(client, ObjectId{1});
  pool.Finish(client);
  WaitUntilIdle(pool, client);
  EXPECT_EQ(pool.GetProgress(client).objects_total, 1);
  EXPECT_TRUE(inbox.Of(2).back().converged);
}

TEST(TrainingPoolTest, BadViewsCostNothingButThemselves) {
  Inbox inbox;
  TrainingPool pool(TinyConfig(), 1);
  const uint64_t client = pool.Register(inbox.Sink());
  ObjectViews offer = Offer(1, 5);
  offer.new_views[1].ray_kind = cv::Mat();
  offer.new_views[2].T_world_camera = {Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, NAN)};
  pool.Offer(client, offer);
  pool.Finish(client);
  WaitUntilIdle(pool, client);
  ASSERT_FALSE(inbox.Of(1).empty());
  EXPECT_EQ(inbox.Of(1).back().views, 3);
}

TEST(TrainingPoolTest, AMovedObjectIsNotTrainedAnewNorSentAgain) {
  Inbox inbox;
  TrainingPool pool(TinyConfig(), 1);
  const uint64_t client = pool.Register(inbox.Sink());
  ObjectViews offer = Offer(1, 5);
  pool.Offer(client, offer);
  pool.Finish(client);
  WaitUntilIdle(pool, client);
  const size_t sent = inbox.Of(1).size();

  const Sim3<World, World> S(1.3, Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ())), {1, 2, 3});
  const ObjectViews moved{.object = ObjectId{1}, .S_new_old = S, .cuboid = Moved(S, offer.cuboid)};
  pool.Offer(client, moved);
  WaitUntilIdle(pool, client);
  EXPECT_EQ(pool.GetProgress(client).steps, 40u);
  EXPECT_EQ(inbox.Of(1).size(), sent);

  // A view that moved against the object is worth some steps more, in the corrected world.
  ObjectViews corrected{.object = ObjectId{1}, .cuboid = moved.cuboid};
  const SE3<Camera, Camera> small(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.01, 0, 0));
  corrected.corrected_views = {{KeyframeId{2}, S.Moved(offer.new_views[1].T_world_camera) * small}};
  pool.Offer(client, corrected);
  WaitUntilIdle(pool, client);
  EXPECT_GT(pool.GetProgress(client).steps, 40u);
  ASSERT_GT(inbox.Of(1).size(), sent);
  const FieldSnapshot last = inbox.Of(1).back();
  EXPECT_TRUE(last.converged);
  EXPECT_EQ(last.views, 5);
  EXPECT_NEAR(last.S_new_first.scale(), 1.3, 1e-9);
  EXPECT_TRUE(last.T_world_object.translation().isApprox(S * offer.cuboid.T_world_object.translation(), 1e-9));
}

TEST(TrainingPoolTest, TellsWhatIsWrongWithAnObject) {
  Inbox inbox;
  TrainingPool pool(TinyConfig(), 1);
  const uint64_t client = pool.Register(inbox.Sink());
  pool.Offer(client, Offer(1, 4));
  ObjectViews bad = Offer(2, 4);
  bad.cuboid.half_extents.z() = NAN;
  pool.Offer(client, bad);
  WaitFor([&] { return pool.GetProgress(client).concerns.size() == 1; });
  auto [object, concern] = pool.GetProgress(client).concerns.front();
  EXPECT_EQ(object, ObjectId{2});
  EXPECT_NE(concern.find("half extents must be positive"), std::string::npos) << concern;
  pool.Offer(client, Offer(2, 5));
  pool.Finish(client);
  WaitUntilIdle(pool, client);
  ASSERT_EQ(pool.GetProgress(client).concerns.size(), 1u);
  concern = pool.GetProgress(client).concerns.front().second;
  EXPECT_EQ(concern.find("half extents"), std::string::npos) << concern;
  EXPECT_NE(concern.find("4 views were refused"), std::string::npos) << concern;
  EXPECT_EQ(inbox.Of(2).back().warning, concern);
  EXPECT_EQ(inbox.Of(1).back().warning, "");
  EXPECT_EQ(inbox.Of(1).back().steps, 40u) << "others go on";
}

TEST(TrainingPoolTest, TimeIsLimitedButNotByHand) {
  NerfConfig config = TinyConfig();
  config.full_budget_steps = 100000;
  config.max_training_time_s = 0.02;
  config.max_training_time_per_view_s = 0.002;
  {
    Inbox inbox;
    TrainingPool pool(config, 1);
    const uint64_t client = pool.Register(inbox.Sink());
    pool.Offer(client, Offer(1, 5));
    pool.Finish(client);
    WaitUntilIdle(pool, client);
    const uint64_t steps = pool.GetProgress(client).steps;
    EXPECT_GT(steps, 0u);
    EXPECT_LT(steps, 100000u);
    EXPECT_TRUE(inbox.Of(1).back().converged);
    EXPECT_EQ(pool.GetProgress(client).progress, 1.0);
  }
  config.full_budget_steps = 200;
  config.max_training_time_s = config.max_training_time_per_view_s = 0;
  TrainingPool pool(config, 0);
  const uint64_t client = pool.Register([](FieldSnapshot) {});
  pool.Offer(client, Offer(1, 5));
  pool.Finish(client);
  pool.TrainSlices(client, 1000);
  EXPECT_EQ(pool.GetProgress(client).steps, 200u);
}

TEST(TrainingPoolTest, WhatComesBeyondThePlansGoesWhereTheLossFallsFastest) {
  NerfConfig config = TinyConfig();
  config.probe_interval_steps = 10;
  config.max_extra_steps = 100000;
  config.min_loss_decrease = 0;
  ObjectViews shown = Offer(1, 5), black = Offer(2, 5);
  for (ObjectView& view : black.new_views) view.color_bgr = cv::Mat::zeros(view.color_bgr.size(), CV_8UC3);
  Inbox inbox;
  TrainingPool pool(config, 0);
  const uint64_t client = pool.Register(inbox.Sink());
  pool.Offer(client, shown);
  pool.Offer(client, black);
  pool.Finish(client);
  pool.TrainSlices(client, 16);  // the plans
  const uint64_t first = inbox.Of(1).back().steps, second = inbox.Of(2).back().steps;
  EXPECT_EQ(first, 40u);
  EXPECT_EQ(second, 40u);
  ObjectField field(config, ObjectId{1}, 1), black_field(config, ObjectId{2}, 2);
  const auto fall = [](ObjectField& f, const ObjectViews& offer) {
    EXPECT_TRUE(f.SetBox(offer.cuboid).ok());
    for (const ObjectView& view : offer.new_views) EXPECT_TRUE(f.AddView(view).ok());
    for (int i = 0; i < 8; ++i) f.Train(5, 1);
    return f.LossFall().value();
  };
  const double falls[] = {fall(field, shown), fall(black_field, black)};
  ASSERT_GT(std::abs(falls[0] - falls[1]), 0.01);
  const uint64_t better = falls[0] > falls[1] ? 1 : 2;
  pool.TrainSlices(client, 2);
  EXPECT_EQ(inbox.Of(better).back().steps, 50u);
  EXPECT_EQ(inbox.Of(3 - better).back().steps, 40u);
}

TEST(TrainingPoolTest, DivergedTrainingNeverLeaves) {
  NerfConfig config = TinyConfig();
  config.learning_rate = config.final_learning_rate = 1e30;  // overflows at once
  Inbox inbox;
  TrainingPool pool(config, 1);
  const uint64_t client = pool.Register(inbox.Sink());
  pool.Offer(client, Offer(1, 4));
  pool.Finish(client);
  WaitUntilIdle(pool, client);  // it is given up after some attempts
  pool.Unregister(client);
  EXPECT_TRUE(inbox.Of(1).empty());
}

TEST(TrainingPoolTest, WithoutWorkersItTrainsByHandAndAlwaysAlike) {
  const auto train = [](std::vector<uint64_t>* steps_seen) {
    NerfConfig config = TinyConfig();
    config.completion_delay_s = 0;  // nothing may depend on time
    config.snapshot_interval_s = 0;
    Inbox inbox;
    TrainingPool pool(config, 0);
    const uint64_t client = pool.Register(inbox.Sink());
    const uint64_t other = pool.Register([](FieldSnapshot) { FAIL() << "not this client's turn"; });
    pool.Offer(other, Offer(1, 5));
    pool.Offer(client, Offer(1, 5));
    pool.Offer(client, Offer(2, 5));
    EXPECT_EQ(pool.GetProgress(client).steps, 0u);
    pool.TrainSlices(client, 3);
    EXPECT_EQ(pool.GetProgress(client).steps, 15u);
    pool.TrainSlices(client, 1000);
    EXPECT_EQ(pool.GetProgress(client).steps, 28u) << "14 steps each while more views may come";
    pool.Finish(client);
    pool.TrainSlices(client, 1000);
    EXPECT_TRUE(pool.Idle(client));
    EXPECT_EQ(pool.GetProgress(client).steps, 80u);

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

}  // namespace
}  // namespace romap::nerf
