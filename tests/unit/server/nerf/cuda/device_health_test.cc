// Missing, failing and too small devices.
#include "tests/unit/server/nerf/cuda/device_test.h"
// The include above defines macros and must come first.
#include "common/status.h"
#include "server/nerf/cuda/cuda_field.h"
#include "tests/unit/server/nerf/cuda/step_on_cpu.h"

namespace romap::nerf::cuda::device_health_test {

using DeviceHealthTest = DeviceTest;

TEST_F(DeviceHealthTest, AWorkingDeviceIsHealthy) { EXPECT_TRUE(DeviceStatus().ok()) << DeviceStatus(); }

TEST_F(DeviceHealthTest, NoDeviceIsReportedInOneLine) {
  cuda_on_host::SetDeviceTraits({.devices = 0});
  EXPECT_EQ(DeviceStatus().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(Message(DeviceStatus()), "CUDA: cannot count devices: no CUDA-capable device is detected");
}

TEST_F(DeviceHealthTest, AFailedDeviceIsNotUsedAgain) {
  cuda_on_host::SetDeviceTraits({.kernels_before_fault = 0});
  EXPECT_EQ(Message(DeviceStatus()), "CUDA: cannot run a kernel on device 0: unspecified launch failure");
  cuda_on_host::SetDeviceTraits({});
  EXPECT_FALSE(DeviceStatus().ok());
}

TEST_F(DeviceHealthTest, OutOfMemoryIsReportedAndLeaksNothing) {
  const size_t before = cuda_on_host::AllocatedBytes();
  const FieldModel field = NoisyField(8, 32);
  cuda_on_host::SetDeviceTraits({.memory_bytes = before + field.table.size() * sizeof(float)});
  const auto device = CudaField::Create(field);
  EXPECT_EQ(Message(device.status()), "CUDA: cannot allocate memory: out of memory");
  EXPECT_EQ(cuda_on_host::AllocatedBytes(), before);
}

TEST_F(DeviceHealthTest, WideFieldsAndUnequalCoordinatesAreRejected) {
  EXPECT_EQ(CudaField::Create(NoisyField(2, 144)).status().code(), absl::StatusCode::kInvalidArgument);
  const auto device = CudaField::Create(NoisyField(2, 16));
  ASSERT_TRUE(device.ok());
  const std::vector<float> three(3, 0.5f), two(2, 0.5f);
  EXPECT_EQ(Message(device->Evaluate(three, two, three).status()),
            "CUDA: x, y and z must have the same length, got 3, 2 and 3");
  EXPECT_TRUE(device->Evaluate({}, {}, {})->empty());
}

}  // namespace romap::nerf::cuda::device_health_test
