// Whole trainings on a device emulated on the host.
#include "tests/unit/server/nerf/cuda/device_test.h"
// The include above defines macros and must come first.
#include <thread>

#include "common/status.h"
#include "server/nerf/cpu/cpu_trainer.h"
#include "server/nerf/cuda/cuda_trainer.h"
#include "tests/unit/server/nerf/cuda/step_on_cpu.h"

namespace romap::nerf::cuda::cuda_trainer_test {

using CudaTrainerTest = DeviceTest;

// Small enough for the host; all events of a training happen within a few steps.
NerfConfig SmallConfig() {
  NerfConfig config;
  config.levels = 3;
  config.log2_table_entries = 9;
  config.finest_resolution = 64;
  config.hidden_width = 16;
  config.rays_per_step = 64;
  config.occupancy_start_step = 4;
  config.occupancy_interval_steps = 3;
  return config;
}

// Rays at a ball in the center of the box.
StepSource BallSource(const NerfConfig& config) {
  StepSource source;
  source.ray = [config](uint64_t step, int index) {
    Ray ray = TestRays(index + 1, 40 + step).back();
    float nearest = 0, distance = 0;
    for (int a = 0; a < 3; ++a) nearest += (0.4f - ray.origin[a]) * ray.direction[a];
    for (int a = 0; a < 3; ++a) distance += std::pow(ray.origin[a] + nearest * ray.direction[a] - 0.4f, 2.0f);
    ray.target.is_object = distance < 0.06f;
    ray.target.depth = -1;
    for (float& c : ray.target.rgb) c = 0.7f;
    return ray;
  };
  source.learning_rate = [](uint64_t step) { return step < 5 ? 0.02f : 0.01f; };
  source.extent = {0.9f, 0.8f, 0.85f};
  source.grid = {.rotation = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, .shift = {0.05f, 0.1f, 0.0f}};
  return source;
}

std::vector<uint8_t> Hull() {
  std::vector<uint8_t> hull(size_t{kOccupancyResolution} * kOccupancyResolution * kOccupancyResolution, 1);
  for (size_t i = 0; i < hull.size(); ++i) hull[i] = i % 64 > 8;
  return hull;
}

std::unique_ptr<Trainer> OnDevice(const NerfConfig& config) {
  EXPECT_TRUE(Supports(config).ok()) << Supports(config);
  return MakeCudaTrainer(config, std::make_unique<CpuTrainer>(config, 3));
}

std::vector<float> AllParameters(const Trainer& trainer) {
  const FieldModel& model = trainer.model();
  std::vector<float> all(model.table.span().begin(), model.table.span().end());
  all.insert(all.end(), model.mlp.parameters.span().begin(), model.mlp.parameters.span().end());
  return all;
}

// Mean distance between the parameters of two fields, relative to the distance of the first from its initialization.
double Deviation(const Trainer& a, const Trainer& b, const NerfConfig& config) {
  const std::vector<float> x = AllParameters(a), y = AllParameters(b), start = AllParameters(CpuTrainer(config, 3));
  double apart = 0, moved = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    apart += std::fabs(x[i] - y[i]);
    moved += std::fabs(x[i] - start[i]);
  }
  return apart / moved;
}

TEST_F(CudaTrainerTest, TrainsAsOnTheCpu) {
  NerfConfig config = SmallConfig();
  const StepSource source = BallSource(config);
  CpuTrainer cpu(config, 3, PlainKernels());
  const std::unique_ptr<Trainer> device = OnDevice(config);
  Occupancy cpu_cells(config), device_cells(config);
  cpu_cells.SetHull(Hull());
  device_cells.SetHull(Hull());
  double first_loss = 0;
  // 18 steps are more than one upload of rays.
  for (const int steps : {1, 2, 18}) {
    const TrainStats want = cpu.Run(source, cpu_cells, steps, 1);
    const TrainStats got = device->Run(source, device_cells, steps, 1);
    EXPECT_EQ(got.steps, steps);
    EXPECT_NEAR(static_cast<double>(got.rays), static_cast<double>(want.rays), 0.01 * static_cast<double>(want.rays));
    EXPECT_NEAR(static_cast<double>(got.samples), static_cast<double>(want.samples),
                0.02 * static_cast<double>(want.samples));
    EXPECT_NEAR(static_cast<double>(got.active_samples), static_cast<double>(want.active_samples),
                0.03 * static_cast<double>(want.samples));
    EXPECT_NEAR(got.color_loss, want.color_loss, 0.02 * want.color_loss);
    EXPECT_EQ(device->steps_done(), cpu.steps_done());
    EXPECT_LT(Deviation(cpu, *device, config), 0.1);
    if (steps == 1) {
      first_loss = want.color_loss;
      EXPECT_EQ(got.samples, want.samples);
      EXPECT_EQ(got.rays, want.rays);
    }
    EXPECT_TRUE(steps < 18 || got.color_loss < 0.9 * first_loss) << got.color_loss;
  }
  // The occupancy after the download: scores, cells, and the weights of the layers.
  const Occupancy::State cpu_state = cpu_cells.state(), device_state = device_cells.state();
  EXPECT_EQ(Difference(cpu_state.score, device_state.score, 0.1), "");
  const auto count = [](const Occupancy::State& cells) {
    int bits = 0;
    for (const uint32_t word : cells.bits) bits += std::popcount(word);
    return bits;
  };
  EXPECT_NEAR(count(device_state), count(cpu_state), 0.03 * count(cpu_state));
  EXPECT_LT(count(device_state), 250000);
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto& want = cpu_state.layer_weight[axis];
    const auto& got = device_state.layer_weight[axis];
    const double most = *std::ranges::max_element(want);
    for (size_t i = 0; i < want.size(); ++i) EXPECT_NEAR(got[i], want[i], 0.1 * most) << axis << ", " << i;
  }
}

TEST_F(CudaTrainerTest, EqualStepsGiveEqualSumsOverBlocks) {
  // Table gradients are summed in the order of the blocks, which is fixed on the host.
  const NerfConfig config = SmallConfig();
  const StepSource source = BallSource(config);
  std::vector<std::vector<float>> results;
  for (int run = 0; run < 2; ++run) {
    const std::unique_ptr<Trainer> trainer = OnDevice(config);
    Occupancy cells(config);
    trainer->Run(source, cells, 3, 1);
    if (run == 1) trainer->ReleaseScratch();  // must keep the trained state
    results.push_back(AllParameters(*trainer));
    trainer->Run(source, cells, 3, 1);
    results.push_back(AllParameters(*trainer));
  }
  EXPECT_EQ(results[0], results[2]);
  EXPECT_EQ(results[1], results[3]);
}

TEST_F(CudaTrainerTest, UsesStateChangedOnTheHost) {
  const NerfConfig config = SmallConfig();
  const StepSource source = BallSource(config);
  CpuTrainer cpu(config, 3, PlainKernels());
  const std::unique_ptr<Trainer> device = OnDevice(config);
  Occupancy cpu_cells(config), device_cells(config);
  cpu.Run(source, cpu_cells, 2, 1);
  device->Run(source, device_cells, 2, 1);
  cpu.ShrinkFeatures(0.5f);
  device->ShrinkFeatures(0.5f);
  cpu_cells.SetHull(Hull());
  device_cells.SetHull(Hull());
  const TrainStats want = cpu.Run(source, cpu_cells, 1, 1);
  const TrainStats got = device->Run(source, device_cells, 1, 1);
  EXPECT_EQ(got.samples, want.samples);
  EXPECT_NEAR(got.color_loss, want.color_loss, 0.02 * want.color_loss);
}

TEST_F(CudaTrainerTest, FieldsOfSeveralThreadsAreIndependent) {
  const NerfConfig config = SmallConfig();
  const StepSource source = BallSource(config);
  std::vector<std::vector<float>> results(3);
  std::vector<std::thread> threads;
  for (size_t i = 0; i < results.size(); ++i) {
    threads.emplace_back([&, i] {
      const std::unique_ptr<Trainer> trainer = OnDevice(config);
      Occupancy cells(config);
      trainer->Run(source, cells, 2, 1);
      results[i] = AllParameters(*trainer);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(results[0], results[1]);
  EXPECT_EQ(results[0], results[2]);
}

TEST_F(CudaTrainerTest, TheCpuContinuesAfterADeviceFailure) {
  const NerfConfig config = SmallConfig();
  const StepSource source = BallSource(config);
  const std::unique_ptr<Trainer> failing = OnDevice(config), stopped = OnDevice(config), unused = OnDevice(config);
  Occupancy failing_cells(config), stopped_cells(config);
  failing->Run(source, failing_cells, 3, 1);
  stopped->Run(source, stopped_cells, 3, 1);
  ASSERT_EQ(AllParameters(*failing), AllParameters(*stopped));

  cuda_on_host::SetDeviceTraits({.kernels_before_fault = 7});  // in the third step
  const TrainStats stats = failing->Run(source, failing_cells, 4, 1);
  EXPECT_EQ(stats.steps, 4);
  EXPECT_EQ(failing->steps_done(), 7u);
  EXPECT_EQ(DeviceStatus().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(Message(DeviceStatus()), "CUDA: cannot train a field: unspecified launch failure");
  EXPECT_EQ(Supports(config), DeviceStatus());
  // Equal to four steps on the CPU; the unfinished steps of the device have no effect.
  stopped->Run(source, stopped_cells, 4, 1);
  EXPECT_EQ(AllParameters(*failing), AllParameters(*stopped));
  EXPECT_EQ(failing_cells.state().score, stopped_cells.state().score);
  EXPECT_EQ(failing_cells.state().layer_weight, stopped_cells.state().layer_weight);
  EXPECT_EQ(cuda_on_host::AllocatedBytes(), 0u);

  // Other fields do not use the device either, even if it would work again.
  cuda_on_host::SetDeviceTraits({});
  Occupancy unused_cells(config), cpu_cells(config);
  unused->Run(source, unused_cells, 2, 1);
  CpuTrainer cpu(config, 3);
  cpu.Run(source, cpu_cells, 2, 1);
  EXPECT_EQ(AllParameters(*unused), AllParameters(cpu));
}

TEST_F(CudaTrainerTest, TheCpuTrainsIfTheDeviceIsOutOfMemory) {
  const NerfConfig config = SmallConfig();
  const std::unique_ptr<Trainer> trainer = OnDevice(config);
  cuda_on_host::SetDeviceTraits({.memory_bytes = 1 << 20});
  Occupancy cells(config);
  EXPECT_EQ(trainer->Run(BallSource(config), cells, 2, 1).steps, 2);
  EXPECT_EQ(trainer->steps_done(), 2u);
  EXPECT_EQ(cuda_on_host::AllocatedBytes(), 0u);
  cuda_on_host::SetDeviceTraits({});
  EXPECT_EQ(trainer->Run(BallSource(config), cells, 1, 1).steps, 1);
  EXPECT_EQ(trainer->steps_done(), 3u);
  EXPECT_GT(cuda_on_host::AllocatedBytes(), 0u);
}

TEST_F(CudaTrainerTest, UnsupportedFieldsAreRejected) {
  NerfConfig config = SmallConfig();
  config.hidden_width = 24;
  EXPECT_EQ(Supports(config).code(), absl::StatusCode::kInvalidArgument);
  config = SmallConfig();
  config.field = "sdf";
  EXPECT_EQ(Message(Supports(config)), "CUDA supports only nerf.field=density, got sdf");
}

TEST_F(CudaTrainerTest, TheConfigurationChoosesTheBackEnd) {
  NerfConfig config = SmallConfig();
  const StepSource source = BallSource(config);
  const auto kernels_run = [&](const char* backend, int devices) {
    ResetDeviceHealth();
    cuda_on_host::SetDeviceTraits({.devices = devices});
    config.backend = backend;
    const std::unique_ptr<Trainer> trainer = MakeTrainer(config, 3);
    const size_t before = cuda_on_host::AllocatedBytes();
    Occupancy cells(config);
    EXPECT_EQ(trainer->Run(source, cells, 1, 1).steps, 1);
    return cuda_on_host::AllocatedBytes() > before;  // the device still stores the field
  };
  EXPECT_TRUE(kernels_run("auto", 1));
  EXPECT_TRUE(kernels_run("cuda", 1));
  EXPECT_FALSE(kernels_run("cpu", 1));
  EXPECT_FALSE(kernels_run("auto", 0));
  EXPECT_FALSE(kernels_run("cuda", 0));
}

}  // namespace romap::nerf::cuda::cuda_trainer_test
