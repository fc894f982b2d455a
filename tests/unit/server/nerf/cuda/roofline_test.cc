// Memory traffic and operations of one training step of the fast preset, counted while it runs on the host, and the
// least time they take according to the data sheets of two devices. Prints the table of server/nerf/cuda/README.md.
#include "tests/unit/server/nerf/cuda/device_test.h"
// The include above defines macros and must come first.
#include "server/nerf/cpu/cpu_trainer.h"
#include "tests/unit/server/nerf/cuda/loaded_step.h"
#include "tests/unit/server/nerf/cuda/step_on_cpu.h"

#ifdef ROMAP_TEST_FINDS_RACES

namespace romap::nerf::cuda {
namespace {

struct Device {
  const char* name;
  double bytes_per_s;         // of memory
  double flops_per_s;         // single precision, a fused multiply-add being two
  double tensor_flops_per_s;  // half precision, sums in single, dense
};
constexpr Device kDevices[] = {{"RTX 4090", 1008e9, 82.6e12, 165.2e12}, {"A100 SXM 40 GB", 1555e9, 19.5e12, 312e12}};

// Single-precision operations of the formulas in math/, counted manually.
constexpr double kPerProbe = 20, kPerSample = 190, kPerLevelForward = 60, kPerLevelBackward = 56, kPerUpdate = 14;

struct Part {
  const char* name;
  cuda_on_host::DeviceTraffic traffic;
  double products = 0;  // of 16 x 16 x 16 tiles
  double flops = 0;
  double Bytes() const { return static_cast<double>(traffic.read + traffic.written + 2 * traffic.atomic); }
  double TensorFlops() const { return products * 2 * 16 * 16 * 16; }
};

class RooflineTest : public DeviceTest {
 protected:
  // Rays through the center of a full box, which get the largest number of samples.
  static StepSource FullRays(const NerfConfig& config) {
    auto rays = std::make_shared<std::vector<Ray>>(TestRays(config.rays_per_step, 8));
    for (size_t r = 0; r < rays->size(); ++r) {
      Ray& ray = (*rays)[r];
      const float y = RandomUniform(3, 0, r), z = RandomUniform(3, 1, r);
      std::ranges::copy(std::array{-1.0f, y, z}, ray.origin);
      std::ranges::copy(std::array{1.0f, 0.0f, 0.0f}, ray.direction);
    }
    return {.ray = [rays](uint64_t, int index) { return (*rays)[static_cast<size_t>(index)]; },
            .learning_rate = [](uint64_t) { return 0.01f; }};
  }

  // Counts and checks one step of the fast preset.
  static void CountStep(int rays_per_step);

  template <class Work>
  static Part Count(const char* name, Work work) {
    cuda_on_host::ResetRaces();
    cuda_on_host::TakeDeviceTraffic();
    const uint64_t before = nvcuda::wmma::tile_products;
    work();
    Part part{.name = name, .traffic = cuda_on_host::TakeDeviceTraffic()};
    part.products = static_cast<double>(nvcuda::wmma::tile_products - before);
    return part;
  }

  static void Print(const std::vector<Part>& parts, const StepCounters& stats) {
    fmt::print("{} rays, {} samples, {} of them with a backward pass\n\n", stats.rays, stats.samples,
               stats.active_samples);
    fmt::print("| launch | bytes read | written | added to | flops on tensor cores | other flops |");
    for (const Device& device : kDevices) fmt::print(" {}: memory | tensor cores | other |", device.name);
    fmt::print("\n| --- | --- | --- | --- | --- | --- |");
    for (size_t i = 0; i < std::size(kDevices); ++i) fmt::print(" --- | --- | --- |");
    for (const Part& part : parts) {
      fmt::print("\n| {} | {:.2f} M | {:.2f} M | {:.2f} M | {:.0f} M | {:.0f} M |", part.name,
                 1e-6 * static_cast<double>(part.traffic.read), 1e-6 * static_cast<double>(part.traffic.written),
                 1e-6 * static_cast<double>(part.traffic.atomic), 1e-6 * part.TensorFlops(), 1e-6 * part.flops);
      for (const Device& device : kDevices) {
        fmt::print(" {:.1f} us | {:.1f} us | {:.1f} us |", 1e6 * part.Bytes() / device.bytes_per_s,
                   1e6 * part.TensorFlops() / device.tensor_flops_per_s, 1e6 * part.flops / device.flops_per_s);
      }
    }
    fmt::print("\n");
  }
};

void RooflineTest::CountStep(int rays_per_step) {
  NerfConfig config;
  config.rays_per_step = rays_per_step;
  CpuTrainer host(config, 1, PlainKernels());
  Occupancy occupancy(config);
  const absl::StatusOr<StepBuffers> buffers =
      LoadStep(config, host.state(), occupancy, FullRays(config), 1, /*stream=*/nullptr);
  ASSERT_TRUE(buffers.ok()) << buffers.status();
  const StepLaunch& launch = buffers->launch();
  std::vector<Part> parts = {
      Count("rays to gradients",
            [&] { ASSERT_EQ(LaunchGradients(launch.step, MlpPath::kTensorCores, nullptr), cudaSuccess); }),
      Count("optimizer and occupancy", [&] { ASSERT_EQ(LaunchOptimize(launch, nullptr), cudaSuccess); })};
  StepCounters stats{};
  ASSERT_TRUE(buffers->counters.Read({&stats, 1}).ok());
  const double rays = config.rays_per_step, samples = static_cast<double>(stats.samples);
  const double active = static_cast<double>(stats.active_samples);
  parts[0].flops = rays * kRayProbes * kPerProbe + samples * (kPerSample + config.levels * kPerLevelForward) +
                   active * config.levels * kPerLevelBackward;
  const double touched = static_cast<double>(parts[1].traffic.written) / (4 * sizeof(float));
  parts[1].flops = touched * kPerUpdate;
  Print(parts, stats);

  EXPECT_EQ(stats.samples, static_cast<unsigned long long>(config.rays_per_step * config.max_samples_per_ray));
  // Per active sample and level four pairs of entries with two features each; per sample two values of its cell.
  const uint64_t adds = stats.active_samples * static_cast<uint64_t>(config.levels) * 16 + 2 * stats.samples;
  EXPECT_NEAR(static_cast<double>(parts[0].traffic.atomic) / sizeof(float), static_cast<double>(adds),
              0.05 * static_cast<double>(adds));
  // Per full tile: 8 rows of matrices in the forward pass, and twice that in the backward pass.
  const int columns = config.hidden_width / 16, inputs = host.model().layout.features / 16;
  const int tiles = config.rays_per_step * config.max_samples_per_ray / kTileSamples;
  const int most = 8 * tiles * (columns * inputs + columns + columns + columns + 2 * columns * inputs);
  EXPECT_LE(parts[0].products, most);
  EXPECT_GT(parts[0].products, 0.8 * most);
  EXPECT_EQ(parts[1].products, 0);
}

TEST_F(RooflineTest, SmallStep) { CountStep(64); }

// Slow; prints the table of the README: --gtest_also_run_disabled_tests --gtest_filter=*TableOfTheReadme
TEST_F(RooflineTest, DISABLED_TableOfTheReadme) { CountStep(NerfConfig{}.rays_per_step); }

}  // namespace
}  // namespace romap::nerf::cuda

#endif
