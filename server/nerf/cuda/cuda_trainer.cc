#include "server/nerf/cuda/cuda_trainer.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "server/nerf/cuda/device_health.h"
#include "server/nerf/cuda/device_training.h"

namespace romap::nerf::cuda {
namespace {

// Holds the field in a trainer of the CPU, which takes over when the device fails.
class CudaTrainer : public Trainer {
 public:
  CudaTrainer(const NerfConfig& config, uint64_t seed) : config_(config), host_(config, seed) {}

  TrainStats Run(const StepSource& source, Occupancy& occupancy, int steps, int threads) override {
    if (DeviceStatus().ok()) {
      const absl::StatusOr<TrainStats> stats = RunOnDevice(source, occupancy, steps);
      if (stats.ok()) return *stats;
      if (absl::IsResourceExhausted(stats.status())) {
        if (!std::exchange(said_, true)) spdlog::warn("a field is trained on the CPU: {}", Message(stats.status()));
      } else {
        MarkUnhealthy(stats.status());
      }
    }
    device_.reset();
    return host_.Run(source, occupancy, steps, threads);
  }

  void FitDistances(const StepSource& source, std::span<const float> distance) override {
    host_.FitDistances(source, distance);
  }

  void Loosen(float share) override { host_.Loosen(share); }

  void ReleaseScratch() override {
    device_.reset();
    host_.ReleaseScratch();
  }

  const FieldModel& model() const override { return host_.model(); }
  uint64_t steps_done() const override { return host_.steps_done(); }

 private:
  absl::StatusOr<TrainStats> RunOnDevice(const StepSource& source, Occupancy& occupancy, int steps) {
    const auto start = std::chrono::steady_clock::now();
    ROMAP_ASSIGN_OR_RETURN(const cudaStream_t stream, StreamOfThread());
    if (!device_) {
      ROMAP_ASSIGN_OR_RETURN(device_, DeviceTraining::Create(config_, host_.model(), MlpPath::kTensorCores, stream));
    }
    TrainStats stats;
    ROMAP_RETURN_IF_ERROR(device_->Upload(host_.state(), occupancy, stream));
    ROMAP_RETURN_IF_ERROR(device_->Train(source, host_.steps_done(), steps, stream, stats));
    ROMAP_RETURN_IF_ERROR(device_->Download(host_.state(), occupancy, stream));
    host_.state().steps_done += static_cast<uint64_t>(steps);
    stats.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return stats;
  }

  NerfConfig config_;
  FieldTrainer host_;
  std::unique_ptr<DeviceTraining> device_;  // none until the next Run()
  bool said_ = false;                       // that there was too little memory
};

}  // namespace

absl::StatusOr<std::unique_ptr<Trainer>> MakeCudaTrainer(const NerfConfig& config, uint64_t seed) {
  ROMAP_RETURN_IF_ERROR(DeviceStatus());
  if (config.hidden_width > kMaxHidden || config.hidden_width % 16 != 0) {
    return InvalidArgument("CUDA: a field with {} hidden neurons; a multiple of 16 up to {} is possible",
                           config.hidden_width, kMaxHidden);
  }
  if (config.encoding != "hash" || config.hidden_layers != 1) {
    return InvalidArgument("CUDA: {} encoding with {} hidden layers; a hash grid with one is possible", config.encoding,
                           config.hidden_layers);
  }
  if (config.field != "density") {
    return InvalidArgument("CUDA: a field of kind {}; density is possible", config.field);
  }
  return std::make_unique<CudaTrainer>(config, seed);
}

}  // namespace romap::nerf::cuda
