#include "server/nerf/trainer.h"

#include <spdlog/spdlog.h>

#include <atomic>
#include <utility>

#include "common/status.h"
#include "server/nerf/cpu/cpu_trainer.h"
#include "server/nerf/cuda/cuda_trainer.h"

namespace romap::nerf {

std::unique_ptr<Trainer> MakeTrainer(const NerfConfig& config, uint64_t seed) {
  std::unique_ptr<Trainer> cpu = std::make_unique<CpuTrainer>(config, seed);
  if (config.backend == "cpu") return cpu;
  const absl::Status cuda = cuda::Supports(config);
  static std::atomic_flag logged;
  if (!logged.test_and_set()) {
    if (cuda.ok()) {
      spdlog::info("training fields on the CUDA device");
    } else {
      spdlog::log(config.backend == "cuda" ? spdlog::level::warn : spdlog::level::info,
                  "training fields on the CPU: {}", Message(cuda));
    }
  }
  return cuda.ok() ? cuda::MakeCudaTrainer(config, std::move(cpu)) : std::move(cpu);
}

}  // namespace romap::nerf
