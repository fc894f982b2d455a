#pragma once

// Tests that run kernels on the host in every order of threads, and fail on races.
// clang-format off
#include "tests/support/cuda_on_host/cuda_on_host.h"
// clang-format on

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "server/nerf/cuda/device_health.h"
#include "tests/support/cuda_on_host/race_checker.h"

namespace romap::nerf::cuda {

class DeviceTest : public testing::Test {
 protected:
  void SetUp() override {
    cuda_on_host::SetRunOptions({});
    cuda_on_host::SetDeviceTraits({});
    ForgetDevice();
  }
  void TearDown() override {
#ifdef ROMAP_TEST_FINDS_RACES
    EXPECT_EQ(cuda_on_host::RaceCount(), 0) << cuda_on_host::FirstRace();
    cuda_on_host::ResetRaces();
#endif
    cuda_on_host::SetDeviceTraits({});
    ForgetDevice();
  }
};

class OrderedDeviceTest : public DeviceTest, public testing::WithParamInterface<cuda_on_host::RunOptions> {
 protected:
  void SetUp() override {
    DeviceTest::SetUp();
    cuda_on_host::SetRunOptions(GetParam());
  }
  void TearDown() override {
    EXPECT_EQ(cudaGetLastError(), cudaSuccess);
    DeviceTest::TearDown();
  }
};

inline auto AllOrders() {
  using cuda_on_host::RunOptions;
  using cuda_on_host::ThreadOrder;
  return testing::Values(RunOptions{ThreadOrder::kForward}, RunOptions{ThreadOrder::kReverse},
                         RunOptions{ThreadOrder::kShuffled, 3}, RunOptions{ThreadOrder::kShuffled, 4, 2, true});
}

inline std::string OrderName(const testing::TestParamInfo<cuda_on_host::RunOptions>& info) {
  return fmt::format("Order{}", info.index);
}

}  // namespace romap::nerf::cuda
