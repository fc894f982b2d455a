#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <vector>

#include "server/nerf/cuda/device_array.h"
#include "server/nerf/cuda/field_kernels.h"
#include "server/nerf/model/field_model.h"

namespace romap::nerf::cuda {

// A copy of a trained field in the memory of the current device.
class CudaField {
 public:
  // INVALID_ARGUMENT if the kernels do not support the model; UNAVAILABLE or RESOURCE_EXHAUSTED on CUDA errors.
  static absl::StatusOr<CudaField> Create(const FieldModel& model);

  // Evaluates the field at n points in Unit space of the grid. x, y, z: n values each. Returns [n][kOutputs]: red,
  // green, blue 0..1 and raw density with its bias. INVALID_ARGUMENT if the lengths differ; UNAVAILABLE or
  // RESOURCE_EXHAUSTED on CUDA errors.
  absl::StatusOr<std::vector<float>> Evaluate(std::span<const float> x, std::span<const float> y,
                                              std::span<const float> z, MlpPath path = MlpPath::kTensorCores) const;

 private:
  CudaField() = default;

  GridLayout grid_;
  int hidden_ = 0;
  float density_bias_ = 0;
  DeviceArray<float> table_, parameters_;
};

}  // namespace romap::nerf::cuda
