#include "server/nerf/cuda/cuda_trainer.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <utility>

#include "server/nerf/cuda/device_health.h"
#include "server/nerf/cuda/device_training.h"

namespace romap::nerf::cuda {
namespace {

// The trainer of the CPU owns the state between runs and takes over if the device fails.
class CudaTrainer : public Trainer {
 public:
  CudaTrainer(const NerfConfig& config, std::unique_ptr<Trainer> cpu) : config_(config), cpu_(std::move(cpu)) {}

  TrainStats Run(const StepSource& source, Occupancy& occupancy, int steps, int threads) override {
    if (DeviceStatus().ok()) {
      const absl::StatusOr<TrainStats> stats = RunOnDevice(source, occupancy, steps);
      if (stats.ok()) return *stats;
      if (!absl::IsResourceExhausted(stats.status())) {
        MarkUnhealthy(stats.status());
      } else if (!std::exchange(memory_warning_logged_, true)) {
        spdlog::warn("the CUDA device is out of memory; training the field on the CPU until memory is available: {}",
                     Message(stats.status()));
      }
    }
    device_.reset();
    return cpu_->Run(source, occupancy, steps, threads);
  }

  void FitDistances(const StepSource& source, std::span<const float> distance) override {
    cpu_->FitDistances(source, distance);
  }

  void ShrinkFeatures(float share) override { cpu_->ShrinkFeatures(share); }

  void ReleaseScratch() override {
    device_.reset();
    cpu_->ReleaseScratch();
  }

  TrainingState& state() override { return cpu_->state(); }
  const FieldModel& model() const override { return cpu_->model(); }
  uint64_t steps_done() const override { return cpu_->steps_done(); }

 private:
  absl::StatusOr<TrainStats> RunOnDevice(const StepSource& source, Occupancy& occupancy, int steps) {
    const auto start = std::chrono::steady_clock::now();
    ROMAP_ASSIGN_OR_RETURN(const cudaStream_t stream, StreamOfThread());
    if (!device_) {
      ROMAP_ASSIGN_OR_RETURN(device_, DeviceTraining::Create(config_, model(), MlpPath::kTensorCores, stream));
    }
    TrainStats stats;
    ROMAP_RETURN_IF_ERROR(device_->Upload(state(), occupancy, stream));
    ROMAP_RETURN_IF_ERROR(device_->Train(source, steps_done(), steps, stream, stats));
    ROMAP_RETURN_IF_ERROR(device_->Download(state(), occupancy, stream));
    state().steps_done += static_cast<uint64_t>(steps);
    stats.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return stats;
  }

  NerfConfig config_;
  std::unique_ptr<Trainer> cpu_;
  std::unique_ptr<DeviceTraining> device_;  // null until the next Run()
  bool memory_warning_logged_ = false;
};

}  // namespace

absl::Status Supports(const NerfConfig& config) {
  ROMAP_RETURN_IF_ERROR(DeviceStatus());
  if (config.hidden_width > kMaxHidden || config.hidden_width % 16 != 0) {
    return InvalidArgument("CUDA supports only nerf.hidden_width=16..{} in multiples of 16, got {}", kMaxHidden,
                           config.hidden_width);
  }
  if (config.encoding != "hash") {
    return InvalidArgument("CUDA supports only nerf.encoding=hash, got {}", config.encoding);
  }
  if (config.hidden_layers != 1) {
    return InvalidArgument("CUDA supports only nerf.hidden_layers=1, got {}", config.hidden_layers);
  }
  if (config.field != "density") {
    return InvalidArgument("CUDA supports only nerf.field=density, got {}", config.field);
  }
  return absl::OkStatus();
}

std::unique_ptr<Trainer> MakeCudaTrainer(const NerfConfig& config, std::unique_ptr<Trainer> cpu) {
  return std::make_unique<CudaTrainer>(config, std::move(cpu));
}

}  // namespace romap::nerf::cuda
