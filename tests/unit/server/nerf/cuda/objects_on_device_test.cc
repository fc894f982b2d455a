// Objects and the training pool on a device emulated on the host.
#include "tests/unit/server/nerf/cuda/device_test.h"
// The include above defines macros and must come first.
#include <chrono>
#include <map>
#include <mutex>
#include <thread>

#include "server/nerf/object_field.h"
#include "server/nerf/training_pool.h"
#include "tests/unit/server/nerf/test_scene.h"

namespace romap::nerf::cuda::objects_on_device_test {

using ObjectsOnDeviceTest = DeviceTest;

NerfConfig TinyConfig() {
  NerfConfig config;
  config.levels = 3;
  config.log2_table_entries = 9;
  config.finest_resolution = 32;
  config.hidden_width = 16;
  config.rays_per_step = 64;
  config.first_budget_steps = 4;
  config.full_budget_steps = 8;
  config.max_samples_per_ray = 8;
  config.slice_steps = 4;
  config.probe_interval_steps = 10;
  config.completion_delay_s = 3600;
  config.max_extra_steps = 0;
  config.max_training_time_s = 3600;
  return config;
}

testing_support::BallScene TinyScene(uint64_t object) {
  testing_support::BallScene scene;
  scene.object = ObjectId{object};
  scene.views = 4;
  scene.size_px = 32;
  return scene;
}

std::vector<float> Train(const NerfConfig& config, int steps) {
  const testing_support::BallScene scene = TinyScene(1);
  ObjectField field(config, scene.object, 5);
  EXPECT_TRUE(field.SetBox(scene.Box()).ok());
  for (const ObjectView& view : scene.Views()) EXPECT_TRUE(field.AddView(view).ok());
  EXPECT_EQ(field.Train(steps, 1).steps, steps);
  EXPECT_EQ(field.steps(), static_cast<uint64_t>(steps));
  return testing_support::RawOnGrid(field.Snapshot(), 0.7f);
}

void WaitUntilIdle(TrainingPool& pool, TrainingPool::SessionId session) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(2);
  while (!pool.IsIdle(session)) {
    ASSERT_LT(std::chrono::steady_clock::now(), end) << "the pool did not become idle within two minutes";
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

TEST_F(ObjectsOnDeviceTest, AnObjectIsTrainedAsOnTheCpu) {
  NerfConfig config = TinyConfig();
  const std::vector<float> on_device = Train(config, 8);
  config.backend = "cpu";
  const std::vector<float> on_cpu = Train(config, 8), at_first = Train(config, 1);
  double apart = 0, moved = 0;
  for (size_t i = 0; i < on_cpu.size(); ++i) {
    apart += std::fabs(on_device[i] - on_cpu[i]);
    moved += std::fabs(at_first[i] - on_cpu[i]);
  }
  EXPECT_LT(apart, 0.1 * moved);
  EXPECT_NE(on_device, on_cpu) << "both were trained on the CPU";
}

TEST_F(ObjectsOnDeviceTest, TrainingTimeIsLimited) {
  NerfConfig config = TinyConfig();
  config.max_training_time_s = 0.001;
  config.max_training_time_per_view_s = 0;
  TrainingPool pool(config, 1);
  const TrainingPool::SessionId session = pool.AddSession([](FieldSnapshot) {});
  const testing_support::BallScene scene = TinyScene(1);
  pool.Offer(session, {.object = scene.object, .cuboid = scene.Box(), .new_views = scene.Views()});
  pool.Finish(session);
  WaitUntilIdle(pool, session);
  EXPECT_EQ(pool.GetProgress(session).steps, 4u) << "one slice takes longer than the limit";
  pool.RemoveSession(session);
}

TEST_F(ObjectsOnDeviceTest, APoolFinishesEveryObjectAfterADeviceFailure) {
  std::mutex mutex;
  std::map<ObjectId, FieldSnapshot> last;
  TrainingPool pool(TinyConfig(), 2);
  const TrainingPool::SessionId session = pool.AddSession([&](FieldSnapshot snapshot) {
    std::lock_guard lock(mutex);
    last[snapshot.object] = std::move(snapshot);
  });
  cuda_on_host::SetDeviceTraits({.kernels_before_fault = 14});  // of 48
  for (uint64_t object = 1; object <= 2; ++object) {
    const testing_support::BallScene scene = TinyScene(object);
    pool.Offer(session, {.object = scene.object, .cuboid = scene.Box(), .new_views = scene.Views()});
  }
  pool.Finish(session);
  WaitUntilIdle(pool, session);
  pool.RemoveSession(session);
  EXPECT_EQ(DeviceStatus().code(), absl::StatusCode::kUnavailable) << "the device has not failed";
  ASSERT_EQ(last.size(), 2u);
  for (const auto& [object, snapshot] : last) {
    EXPECT_TRUE(snapshot.converged);
    EXPECT_EQ(snapshot.steps, 8u);
    for (const float raw : testing_support::RawOnGrid(snapshot)) ASSERT_TRUE(std::isfinite(raw));
  }
  EXPECT_EQ(cuda_on_host::AllocatedBytes(), 0u);
}

}  // namespace romap::nerf::cuda::objects_on_device_test
