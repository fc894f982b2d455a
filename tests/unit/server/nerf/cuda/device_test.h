#pragma once

// Fixtures for the tests of kernels. They run on the host, in several orders of threads, and fail on races; with
// ROMAP_TEST_ON_DEVICE they run on a real device.
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
inline void ResetDeviceHealth() {}
inline void ExpectNoRaces() {}
inline auto AllOrders() { return testing::Values(0); }

#else

using cuda_on_host::RunOptions;

// The next DeviceStatus() tests the device again; see kernels_on_host.cc.
void ResetDeviceHealth();

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
  return testing::Values(RunOptions{ThreadOrder::kForward}, RunOptions{ThreadOrder::kReverse},
                         RunOptions{ThreadOrder::kShuffled, 3}, RunOptions{ThreadOrder::kShuffled, 4, 2, true});
}

#endif

class DeviceTest : public testing::Test {
 protected:
  void SetUp() override {
    UseMachine({});
    ResetDeviceHealth();
  }
  void TearDown() override {
    ExpectNoRaces();
    UseMachine({});
    ResetDeviceHealth();
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
