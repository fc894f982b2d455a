#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <memory>
#include <span>
#include <utility>

#include "server/nerf/cpu/field_trainer.h"
#include "server/nerf/cuda/device_array.h"
#include "server/nerf/cuda/field_kernels.h"

namespace romap::nerf::cuda {

// A stream that is destroyed with its owner.
class Stream {
 public:
  static absl::StatusOr<Stream> Create();
  Stream(Stream&& other) noexcept : stream_(std::exchange(other.stream_, nullptr)) {}
  ~Stream() {
    if (stream_ != nullptr) cudaStreamDestroy(stream_);
  }
  cudaStream_t get() const { return stream_; }

 private:
  Stream() = default;
  cudaStream_t stream_ = nullptr;
};

// The calling thread's own stream, made at its first call.
absl::StatusOr<cudaStream_t> StreamOfThread();

// One field in training on the device: its arrays, and a training step captured as a graph. Errors are those
// of ToStatus.
class DeviceTraining {
 public:
  static constexpr int kSteps = 16;  // of one upload of rays

  // Allocates and captures; nothing is copied yet.
  static absl::StatusOr<std::unique_ptr<DeviceTraining>> Create(const NerfConfig& config, const FieldModel& model,
                                                                MlpPath path, cudaStream_t stream);
  ~DeviceTraining();

  // Copies model, moments and occupancy to the device, before steps, and back, after them. Download changes nothing on
  // the host unless all of it arrived; it waits for the stream.
  absl::Status Upload(const FieldTrainer::State& field, const Occupancy& occupancy, cudaStream_t stream);
  absl::Status Download(FieldTrainer::State field, Occupancy& occupancy, cudaStream_t stream);

  // `steps` steps, the first of them number `first_step` since training began; adds to `stats`.
  absl::Status Train(const StepSource& source, uint64_t first_step, int steps, cudaStream_t stream, TrainStats& stats);

  // For measurements, with the rays of the last Train(): copies them once more; and launches the first kernel of a step
  // (`gradients`) or the others, without a graph. The field is of no use afterwards.
  cudaError_t UploadRays(cudaStream_t stream);
  cudaError_t LaunchOne(bool gradients, cudaStream_t stream);

 private:
  // What the host prepares of the next steps while the device works on those before.
  struct Batch {
    PinnedArray<Ray> rays;             // [kSteps][rays_per_step]
    PinnedArray<float> learning_rate;  // [kSteps]
    PinnedArray<SliceState> slice;     // [1]
    PinnedArray<float> color_loss;     // [kSteps][rays_per_step], comes back
    cudaEvent_t done = nullptr;        // the device has no more business with it
    int steps = 0;                     // waiting to be taken in
  };

  DeviceTraining() = default;
  absl::Status Allocate(const FieldModel& model);
  void DescribeStep(const NerfConfig& config, const FieldModel& model);
  absl::Status Capture(cudaStream_t stream);
  absl::Status Launch(const StepSource& source, uint64_t first_step, int steps, Batch& batch, cudaStream_t stream);
  absl::Status TakeIn(Batch& batch, double& loss, uint64_t& rays) const;

  MlpPath path_ = MlpPath::kTensorCores;
  StepLaunch launch_ = {};
  int rays_per_step_ = 0;
  int step_blocks_ = 0;
  cudaGraphExec_t graph_ = nullptr;
  Batch batches_[2];
  DeviceArray<Ray> rays_;
  DeviceArray<float> learning_rate_, color_loss_;
  DeviceArray<SliceState> slice_;
  DeviceArray<StepCounters> counters_;
  DeviceArray<float> table_, table_first_, table_second_, table_gradient_;
  DeviceArray<float> mlp_, mlp_first_, mlp_second_, mlp_partial_;
  DeviceArray<float> score_;
  DeviceArray<uint32_t> cell_visits_, cell_weight_, hull_bits_, live_bits_, occupied_bits_;
  DeviceArray<unsigned long long> layer_weight_;
};

}  // namespace romap::nerf::cuda
