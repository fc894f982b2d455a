#include "server/nerf/trainer.h"

#include <spdlog/spdlog.h>

#include <atomic>
#include <utility>

#include "common/status.h"
#include "server/nerf/cpu/field_trainer.h"
#include "server/nerf/cuda/cuda_trainer.h"

namespace romap::nerf {

std::unique_ptr<Trainer> MakeTrainer(const NerfConfig& config, uint64_t seed) {
  if (config.backend != "cpu") {
    static std::atomic_flag said;
    absl::StatusOr<std::unique_ptr<Trainer>> trainer = cuda::MakeCudaTrainer(config, seed);
    if (!said.test_and_set()) {
      if (trainer.ok()) {
        spdlog::info("fields are trained on a CUDA device");
      } else {
        spdlog::log(config.backend == "cuda" ? spdlog::level::warn : spdlog::level::info,
                    "fields are trained on the CPU: {}", Message(trainer.status()));
      }
    }
    if (trainer.ok()) return std::move(trainer).value();
  }
  return std::make_unique<FieldTrainer>(config, seed);
}

}  // namespace romap::nerf
