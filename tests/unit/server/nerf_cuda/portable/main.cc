// cuda_engine_check: holds the CUDA kernels against the CPU on the device of this machine, then prints how long a
// training takes there, as the paper's Table 3. Exits with 2 when there is no device, with 1 when a check failed.
#include <gtest/gtest.h>

#include <cstdio>

#include "common/status.h"
#include "server/nerf/cuda/device_health.h"
#include "tests/unit/server/nerf_cuda/runtime_table.h"

namespace romap::nerf::cuda {
namespace {

// The field and the iteration of the paper's section on the implementation.
NerfConfig PaperConfig() {
  NerfConfig config;
  config.levels = 16;
  config.log2_table_entries = 16;
  config.finest_resolution = 2048;
  config.hidden_width = 64;
  config.rays_per_step = 4096;
  config.max_samples_per_ray = 32;
  config.sampling = "uniform";
  return config;
}

int Main(int argc, char** argv) {
  if (const absl::Status status = DeviceStatus(); !status.ok()) {
    std::printf("%s\n", Message(status).c_str());
    return 2;
  }
  testing::InitGoogleTest(&argc, argv);
  if (RUN_ALL_TESTS() != 0) return 1;
  constexpr int kSteps = 320;
  std::vector<RuntimeTable> tables;
  for (const auto& [config, name] : {std::pair(NerfConfig{}, "fast"), std::pair(PaperConfig(), "paper's field")}) {
    const absl::StatusOr<RuntimeTable> table = MeasureRuntime(config, name, kSteps);
    if (!table.ok()) {
      std::printf("%s\n", Message(table.status()).c_str());
      return 1;
    }
    tables.push_back(*table);
  }
  std::printf("\n%s", Markdown(DeviceName(), tables).c_str());
  return 0;
}

}  // namespace
}  // namespace romap::nerf::cuda

int main(int argc, char** argv) { return romap::nerf::cuda::Main(argc, argv); }
