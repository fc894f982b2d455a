#include "server/nerf/trainer.h"

#include "server/nerf/cpu/field_trainer.h"

namespace romap::nerf {

std::unique_ptr<Trainer> MakeTrainer(const NerfConfig& config, uint64_t seed) {
  return std::make_unique<FieldTrainer>(config, seed);
}

}  // namespace romap::nerf
