#include "server/nerf/cuda/device_health.h"

#include <spdlog/spdlog.h>

#include <mutex>
#include <optional>
#include <vector>

#include "server/nerf/cuda/device_array.h"
#include "server/nerf/cuda/field_kernels.h"

namespace romap::nerf::cuda {
namespace {

struct Health {
  std::mutex mutex;
  std::optional<absl::Status> status;  // empty: not tested yet
};

Health& TheHealth() {
  static Health health;
  return health;
}

absl::Status Probe() {
  int count = 0;
  ROMAP_RETURN_IF_ERROR(ToStatus(cudaGetDeviceCount(&count), "count devices"));
  if (count == 0) return absl::UnavailableError("CUDA: no device found");
  ROMAP_RETURN_IF_ERROR(ToStatus(cudaSetDevice(0), "use device 0"));
  // A device that is listed may be too old or broken to run these kernels, so a field of zeros is evaluated as a test.
  DeviceField field{};
  field.grid.features = 16;
  field.hidden = 16;
  const std::vector<float> zeros(16 * 16 + kOutputs * 16);
  ROMAP_ASSIGN_OR_RETURN(DeviceArray<float> parameters, DeviceArray<float>::CopyOf(zeros));
  ROMAP_ASSIGN_OR_RETURN(DeviceArray<float> value, DeviceArray<float>::Allocate(kOutputs));
  field.table = field.parameters = parameters.data();
  const float* zero = parameters.data();
  ROMAP_RETURN_IF_ERROR(
      ToStatus(LaunchEvaluate({field, 1, zero, zero, zero, value.data()}, MlpPath::kTensorCores, nullptr),
               "run a kernel on device 0"));
  std::vector<float> outputs(kOutputs);
  ROMAP_RETURN_IF_ERROR(value.Read(outputs));
  if (outputs[0] != 0.5f) return absl::UnavailableError("CUDA: device 0 returned wrong values in the self-test");
  return absl::OkStatus();
}

}  // namespace

absl::Status DeviceStatus() {
  Health& health = TheHealth();
  std::lock_guard lock(health.mutex);
  if (!health.status) health.status = Probe();
  return *health.status;
}

void MarkUnhealthy(const absl::Status& reason) {
  Health& health = TheHealth();
  std::lock_guard lock(health.mutex);
  if (health.status && !health.status->ok()) return;
  health.status = reason;
  spdlog::error("the CUDA device failed; falling back to the CPU for all fields: {}", Message(reason));
}

}  // namespace romap::nerf::cuda
