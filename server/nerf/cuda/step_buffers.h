#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include "server/nerf/cuda/device_array.h"
#include "server/nerf/cuda/field_kernels.h"
#include "server/nerf/model/occupancy.h"
#include "server/nerf/model/training_state.h"

namespace romap::nerf::cuda {

// The device arrays of one field in training, and the launches of a step on them. Errors are those of ToStatus.
class StepBuffers {
 public:
  // Allocates the arrays without copying data. An upload holds the rays of `steps` steps.
  static absl::StatusOr<StepBuffers> Create(const NerfConfig& config, const FieldModel& model, int steps);

  // Copies model, moments and occupancy to the device, and waits for the copies.
  absl::Status Upload(const TrainingState& field, const Occupancy& occupancy, cudaStream_t stream);
  // Copies them back and waits for the stream. On errors `field` and `occupancy` are unchanged.
  absl::Status Download(TrainingState& field, Occupancy& occupancy, cudaStream_t stream);

  const StepLaunch& launch() const { return launch_; }

  // Input and output of the steps of an upload; see StepParams and OptimizeParams.
  DeviceArray<Ray> rays;               // [steps][rays_per_step]
  DeviceArray<float> learning_rate;    // [steps]
  DeviceArray<float> color_loss;       // [steps][rays_per_step]
  DeviceArray<SliceState> slice;       // [1]
  DeviceArray<StepCounters> counters;  // [1]

 private:
  StepBuffers() = default;
  absl::Status Allocate(const FieldModel& model, int rays_per_step, int steps, int step_blocks);
  void DescribeLaunch(const NerfConfig& config, const FieldModel& model, int step_blocks);

  StepLaunch launch_ = {};
  DeviceArray<float> table_, table_first_, table_second_, table_gradient_;
  DeviceArray<float> mlp_, mlp_first_, mlp_second_, mlp_partial_;
  DeviceArray<float> score_;
  DeviceArray<uint32_t> cell_visits_, cell_weight_, hull_bits_, live_bits_, occupied_bits_;
  DeviceArray<unsigned long long> layer_weight_;
};

}  // namespace romap::nerf::cuda
