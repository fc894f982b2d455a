#pragma once

// The CUDA back end of the field engine, first form. NOT wired into training: TrainingPool and TrainedField run on the
// CPU whether or not a device is there. What exists: evaluating a field on a device (this file), and the kernels of a
// training step (field_kernels.h), which tests run on the host and hold against the CPU's.

#include <absl/status/statusor.h>

#include <span>
#include <vector>

#include "server/nerf/cpu/field_model.h"
#include "server/nerf/cuda/device_array.h"

namespace romap::nerf::cuda {

// Number of CUDA devices. UNAVAILABLE, in one line, when there is none or no driver, or when the first one fails at
// running a kernel of this build.
absl::StatusOr<int> ProbeDevices();

// A copy of a trained field in the memory of the current device.
class CudaField {
 public:
  // INVALID_ARGUMENT when the model is larger than the kernels allow (kMaxHidden); UNAVAILABLE on any CUDA error.
  static absl::StatusOr<CudaField> Create(const FieldModel& model);

  // [n][kOutputs]: red, green, blue 0..1 and raw density with its bias, at n points of Unit space. x, y, z: n values
  // each, 0..1. INVALID_ARGUMENT when their lengths differ; UNAVAILABLE on any CUDA error.
  absl::StatusOr<std::vector<float>> Evaluate(std::span<const float> x, std::span<const float> y,
                                              std::span<const float> z) const;

 private:
  CudaField() = default;

  GridLayout grid_;
  int hidden_ = 0;
  float density_bias_ = 0;
  DeviceArray<float> table_, parameters_;
};

}  // namespace romap::nerf::cuda
