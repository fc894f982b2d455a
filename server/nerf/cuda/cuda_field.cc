#include "server/nerf/cuda/cuda_field.h"

namespace romap::nerf::cuda {

absl::StatusOr<CudaField> CudaField::Create(const FieldModel& model) {
  if (model.mlp.hidden > kMaxHidden) {
    return InvalidArgument("CUDA supports at most {} hidden neurons, got {}", kMaxHidden, model.mlp.hidden);
  }
  if (model.NeedsGeneralKernels()) {
    return InvalidArgument("CUDA supports only a hash grid with one hidden layer, got {} octaves and {} hidden layers",
                           model.layout.octaves, model.mlp.layers);
  }
  CudaField field;
  field.grid_ = model.layout;
  field.hidden_ = model.mlp.hidden;
  field.density_bias_ = model.density_bias;
  ROMAP_ASSIGN_OR_RETURN(field.table_, DeviceArray<float>::CopyOf(model.table.span()));
  ROMAP_ASSIGN_OR_RETURN(field.parameters_, DeviceArray<float>::CopyOf(model.mlp.parameters.span()));
  return field;
}

absl::StatusOr<std::vector<float>> CudaField::Evaluate(std::span<const float> x, std::span<const float> y,
                                                       std::span<const float> z, MlpPath path) const {
  if (x.size() != y.size() || x.size() != z.size()) {
    return InvalidArgument("CUDA: x, y and z must have the same length, got {}, {} and {}", x.size(), y.size(),
                           z.size());
  }
  std::vector<float> value(x.size() * kOutputs);
  if (x.empty()) return value;
  ROMAP_ASSIGN_OR_RETURN(const DeviceArray<float> device_x, DeviceArray<float>::CopyOf(x));
  ROMAP_ASSIGN_OR_RETURN(const DeviceArray<float> device_y, DeviceArray<float>::CopyOf(y));
  ROMAP_ASSIGN_OR_RETURN(const DeviceArray<float> device_z, DeviceArray<float>::CopyOf(z));
  ROMAP_ASSIGN_OR_RETURN(DeviceArray<float> device_value, DeviceArray<float>::Allocate(value.size()));
  const EvaluateParams params{.field = {grid_, table_.data(), parameters_.data(), hidden_, density_bias_},
                              .count = static_cast<int>(x.size()),
                              .x = device_x.data(),
                              .y = device_y.data(),
                              .z = device_z.data(),
                              .value = device_value.data()};
  ROMAP_RETURN_IF_ERROR(ToStatus(LaunchEvaluate(params, path, nullptr), "evaluate a field"));
  ROMAP_RETURN_IF_ERROR(device_value.Read(value));
  return value;
}

}  // namespace romap::nerf::cuda
