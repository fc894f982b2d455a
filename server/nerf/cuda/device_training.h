#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>

#include "server/nerf/cuda/device_array.h"
#include "server/nerf/cuda/field_kernels.h"
#include "server/nerf/cuda/step_buffers.h"
#include "server/nerf/model/step_source.h"
#include "server/nerf/train_stats.h"

namespace romap::nerf::cuda {

// The stream of the calling thread, created at its first call.
absl::StatusOr<cudaStream_t> StreamOfThread();

// Trains one field on the device: a training step captured as a graph, and the rays for it. Errors are those of
// ToStatus.
class DeviceTraining {
 public:
  // Allocates memory and captures the step without copying data.
  static absl::StatusOr<std::unique_ptr<DeviceTraining>> Create(const NerfConfig& config, const FieldModel& model,
                                                                MlpPath path, cudaStream_t stream);
  ~DeviceTraining();

  // See StepBuffers. Call Upload before Train and Download after it.
  absl::Status Upload(const TrainingState& field, const Occupancy& occupancy, cudaStream_t stream) {
    return buffers_.Upload(field, occupancy, stream);
  }
  absl::Status Download(TrainingState& field, Occupancy& occupancy, cudaStream_t stream) {
    return buffers_.Download(field, occupancy, stream);
  }

  // Runs `steps` steps; `first_step` is the number of steps done before. Adds to `stats`.
  absl::Status Train(const StepSource& source, uint64_t first_step, int steps, cudaStream_t stream, TrainStats& stats);

 private:
  // Input that the host prepares for the next steps while the device runs the previous ones.
  struct Batch {
    PinnedArray<Ray> rays;             // [kSteps][rays_per_step]
    PinnedArray<float> learning_rate;  // [kSteps]
    PinnedArray<SliceState> slice;     // [1]
    PinnedArray<float> color_loss;     // out, [kSteps][rays_per_step]
    cudaEvent_t done = nullptr;        // the device has finished this batch
    int steps = 0;                     // steps whose losses have not been collected
  };

  explicit DeviceTraining(StepBuffers buffers) : buffers_(std::move(buffers)) {}
  absl::Status AllocateBatches();
  absl::Status Capture(cudaStream_t stream);
  absl::Status Launch(const StepSource& source, uint64_t first_step, int steps, Batch& batch, cudaStream_t stream);
  absl::Status CollectLosses(Batch& batch, double& loss, uint64_t& rays) const;

  StepBuffers buffers_;
  MlpPath path_ = MlpPath::kTensorCores;
  int rays_per_step_ = 0;
  cudaGraphExec_t graph_ = nullptr;
  Batch batches_[2];
};

}  // namespace romap::nerf::cuda
