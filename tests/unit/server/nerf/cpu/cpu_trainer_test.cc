// Tests that a training step allocates no memory and that equal input gives equal results.
#include "server/nerf/cpu/cpu_trainer.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>
#include <vector>

#include "server/nerf/math/random.h"

namespace {

std::atomic<long> g_allocations = 0;

void* Allocate(size_t bytes, size_t alignment) {
  g_allocations.fetch_add(1, std::memory_order_relaxed);
  void* memory = std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

// Counts the allocations of the whole program. Not inlined, because GCC would report std::free() as a mismatch with
// `new`.
void* operator new(size_t bytes) { return Allocate(bytes, alignof(std::max_align_t)); }
void* operator new[](size_t bytes) { return Allocate(bytes, alignof(std::max_align_t)); }
void* operator new(size_t bytes, std::align_val_t alignment) { return Allocate(bytes, static_cast<size_t>(alignment)); }
[[gnu::noinline]] void operator delete(void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete[](void* memory) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, size_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete[](void* memory, size_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
[[gnu::noinline]] void operator delete(void* memory, size_t, std::align_val_t) noexcept { std::free(memory); }

namespace romap::nerf {
namespace {

NerfConfig SmallConfig() {
  NerfConfig config;
  config.log2_table_entries = 10;
  config.rays_per_step = 256;
  config.occupancy_start_step = 0;
  config.occupancy_interval_steps = 5;
  return config;
}

// A ray at a ball of radius 0.3 in the center of the box, from a random direction.
Ray BallRay(uint64_t step, int index) {
  const uint64_t i = static_cast<uint64_t>(index);
  const Eigen::Vector3f center(0.5f, 0.5f, 0.5f);
  Eigen::Vector3f out(RandomUniform(1, step, 8 * i) - 0.5f, RandomUniform(1, step, 8 * i + 1) - 0.5f, 0.3f);
  out.normalize();
  const Eigen::Vector3f through(RandomUniform(2, step, 8 * i), RandomUniform(2, step, 8 * i + 1), 0.5f);
  const Eigen::Vector3f away = (through - center) - out * out.dot(through - center);
  Ray ray;
  for (int a = 0; a < 3; ++a) {
    ray.origin[a] = through[a] + 2 * out[a];
    ray.direction[a] = -out[a];
    ray.target.rgb[a] = 0.2f + 0.3f * static_cast<float>(a);
  }
  ray.jitter = RandomUniform(3, step, i);
  ray.target.is_object = away.norm() < 0.3f;
  return ray;
}

StepSource BallSource() {
  return {.ray = BallRay, .learning_rate = [](uint64_t) { return 0.02f; }};
}

std::vector<float> Trained(int threads, const std::vector<int>& runs) {
  const NerfConfig config = SmallConfig();
  CpuTrainer trainer(config, 7);
  Occupancy occupancy(config);
  for (const int steps : runs) trainer.Run(BallSource(), occupancy, steps, threads);
  const auto table = trainer.model().table.span(), mlp = trainer.model().mlp.parameters.span();
  std::vector<float> parameters(table.begin(), table.end());
  parameters.insert(parameters.end(), mlp.begin(), mlp.end());
  return parameters;
}

TEST(CpuTrainerTest, StepsAllocateNothing) {
  for (const int threads : {1, 2}) {
    const NerfConfig config = SmallConfig();
    CpuTrainer trainer(config, 7);
    Occupancy occupancy(config);
    const StepSource source = BallSource();
    const auto allocations_of = [&](int steps) {
      const long before = g_allocations;
      trainer.Run(source, occupancy, steps, threads);
      return g_allocations - before;
    };
    allocations_of(2);
    EXPECT_EQ(allocations_of(40), allocations_of(5)) << "threads " << threads;  // starting threads allocates memory
  }
}

TEST(CpuTrainerTest, SameInputAndThreadCountGiveIdenticalResults) {
  for (const int threads : {1, 2, 3}) {
    const std::vector<float> once = Trained(threads, {12});
    EXPECT_EQ(once, Trained(threads, {12})) << "threads " << threads;
    EXPECT_EQ(once, Trained(threads, {5, 7})) << "threads " << threads;
  }
}

TEST(CpuTrainerTest, TwoThreadsGiveTheResultOfOneUpToRounding) {
  const std::vector<float> one = Trained(1, {8}), two = Trained(2, {8});
  const std::vector<float> untrained = Trained(1, {});
  double moved = 0, apart = 0;
  for (size_t i = 0; i < one.size(); ++i) {
    moved += std::fabs(one[i] - untrained[i]);
    apart += std::fabs(one[i] - two[i]);
  }
  ASSERT_GT(moved, 0);
  EXPECT_LT(apart, 0.05 * moved);  // the order of sums differs
}

TEST(CpuTrainerTest, PhasesSumToTheTimeOfTheThreads) {
  const NerfConfig config = SmallConfig();
  CpuTrainer trainer(config, 7);
  Occupancy occupancy(config);
  const TrainStats stats = trainer.Run(BallSource(), occupancy, 20, 2);
  EXPECT_EQ(stats.steps, 20);
  EXPECT_GT(stats.samples, stats.active_samples);
  EXPECT_GT(stats.active_samples, 0u);
  for (const double phase_s : stats.phase_cpu_s) EXPECT_GT(phase_s, 0);
  EXPECT_LT(stats.CpuSeconds(), 2.5 * stats.wall_s);  // two threads, and the resolution of the clocks
}

}  // namespace
}  // namespace romap::nerf
