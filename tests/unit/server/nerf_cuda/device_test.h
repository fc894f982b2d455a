#pragma once

// Fixtures of the tests of kernels. They run on the host, in every order of threads, and fail on races; with
// ROMAP_TEST_ON_DEVICE they run on a real device, in its own order.
// clang-format off
#ifndef ROMAP_TEST_ON_DEVICE
#include "tests/support/cuda_on_host/cuda_on_host.h"
#endif
// clang-format on

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "server/nerf/cuda/device_array.h"
#include "server/nerf/cuda/device_health.h"

#ifndef ROMAP_TEST_ON_DEVICE
#include "tests/support/cuda_on_host/race_checker.h"
#endif

namespace romap::nerf::cuda {

#ifdef ROMAP_TEST_ON_DEVICE

using RunOptions = int;
inline void UseMachine(const RunOptions&) {}
inline void ExpectNoRaces() {}
inline auto AllOrders() { return testing::Values(0); }

#else

using cuda_on_host::RunOptions;

inline void UseMachine(const RunOptions& options) {
  cuda_on_host::SetRunOptions(options);
  cuda_on_host::SetDeviceTraits({});
}

inline void ExpectNoRaces() {
#ifdef ROMAP_TEST_FINDS_RACES
  EXPECT_EQ(cuda_on_host::RaceCount(), 0) << cuda_on_host::FirstRace();
  cuda_on_host::ResetRaces();
#endif
}

inline auto AllOrders() {
  using cuda_on_host::ThreadOrder;
  return testing::Values(RunOptions{cuda_on_host::ThreadOrder::kForward},
                         RunOptions{cuda_on_host::ThreadOrder::kReverse},
                         RunOptions{cuda_on_host::ThreadOrder::kShuffled, 3},
                         RunOptions{cuda_on_host::ThreadOrder::kShuffled, 4, 2, true});
}

#endif

class DeviceTest : public testing::Test {
 protected:
  void SetUp() override {
    UseMachine({});
    ForgetDevice();
  }
  void TearDown() override {
    ExpectNoRaces();
    UseMachine({});
    ForgetDevice();
  }
};

class OrderedDeviceTest : public DeviceTest, public testing::WithParamInterface<RunOptions> {
 protected:
  void SetUp() override {
    DeviceTest::SetUp();
    UseMachine(GetParam());
  }
  void TearDown() override {
    EXPECT_EQ(cudaGetLastError(), cudaSuccess);
    DeviceTest::TearDown();
  }
};

inline std::string OrderName(const testing::TestParamInfo<RunOptions>& info) {
  return fmt::format("Order{}", info.index);
}

}  // namespace romap::nerf::cuda
