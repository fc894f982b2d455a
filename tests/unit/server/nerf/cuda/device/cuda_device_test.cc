// Tests the code compiled by nvcc on this machine: it must match the CPU if there is a device, and otherwise report
// that there is none.
#include <gtest/gtest.h>

#include "server/nerf/cpu/kernels.h"
#include "server/nerf/cuda/cuda_field.h"
#include "server/nerf/cuda/device_health.h"
#include "tests/unit/server/nerf/cuda/step_on_cpu.h"

namespace romap::nerf::cuda::cuda_device_test {

TEST(CudaDeviceTest, FieldOnTheDeviceHasTheValuesOfTheCpu) {
  if (!DeviceStatus().ok()) GTEST_SKIP() << Message(DeviceStatus());
  constexpr size_t kPoints = 301;
  const FieldModel field = NoisyField(8, 32);
  SampleChunk c(kPoints, field.layout.features, field.mlp.hidden);
  c.size = kPoints;
  for (size_t i = 0; i < kPoints; ++i) {
    c.x[i] = RandomUniform(1, 0, i);
    c.y[i] = RandomUniform(1, 1, i);
    c.z[i] = RandomUniform(1, 2, i);
  }
  PlainKernels().encode(field.layout, field.table.data(), kPoints, c.x.data(), c.y.data(), c.z.data(),
                        c.features.data());
  PlainKernels().mlp_forward(field.mlp, kPoints, c.features.data(), c.hidden.data(), c.raw.data());
  std::vector<float> want, got;
  for (size_t i = 0; i < kPoints; ++i) want.push_back(c.raw[kOutputs * i + 3] + field.density_bias);
  const auto device = CudaField::Create(field);
  ASSERT_TRUE(device.ok()) << device.status();
  const auto value = device->Evaluate(c.x.span().first(kPoints), c.y.span().first(kPoints), c.z.span().first(kPoints));
  ASSERT_TRUE(value.ok()) << value.status();
  for (size_t i = 0; i < kPoints; ++i) got.push_back((*value)[kOutputs * i + 3]);
  EXPECT_EQ(Difference(want, got, 2e-3), "");
}

TEST(CudaDeviceTest, NoDeviceIsReportedInOneLine) {
  const absl::Status status = DeviceStatus();
  if (status.ok()) GTEST_SKIP() << "there is a device";
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_TRUE(Message(status).starts_with("CUDA: ")) << status;
  EXPECT_EQ(Message(status).find('\n'), std::string::npos) << status;
  EXPECT_EQ(CudaField::Create(NoisyField(2, 16)).status().code(), absl::StatusCode::kUnavailable);
}

}  // namespace romap::nerf::cuda::cuda_device_test
