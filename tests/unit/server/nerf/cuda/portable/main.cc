// cuda_engine_check: compares the CUDA kernels with the CPU on the device of this machine, then prints the times of a
// training there in the rows of the paper's Table 3. Exits with 2 if there is no device, with 1 if a check failed.
#include <gtest/gtest.h>

#include <cstdio>

#include "common/status.h"
#include "server/nerf/cuda/device_health.h"
#include "server/nerf/presets.h"
#include "tests/unit/server/nerf/cuda/runtime_table.h"

namespace romap::nerf::cuda {
namespace {

int Main(int argc, char** argv) {
  if (const absl::Status status = DeviceStatus(); !status.ok()) {
    std::printf("%s\n", Message(status).c_str());
    return 2;
  }
  testing::InitGoogleTest(&argc, argv);
  if (RUN_ALL_TESTS() != 0) return 1;
  constexpr int kSteps = 320;
  std::vector<RuntimeTable> tables;
  for (const auto& [config, name] :
       {std::pair(NerfConfig{}, "fast"), std::pair(*NerfPreset("paper"), "paper's field")}) {
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
