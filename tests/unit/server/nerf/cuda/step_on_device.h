#pragma once

// One training step with the CUDA kernels.

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "server/nerf/cuda/device_array.h"
#include "server/nerf/cuda/field_kernels.h"
#include "tests/unit/server/nerf/cuda/step_on_cpu.h"

namespace romap::nerf::cuda {

template <class T>
DeviceArray<T> ToDevice(std::span<const T> values) {
  absl::StatusOr<DeviceArray<T>> array = DeviceArray<T>::CopyOf(values);
  EXPECT_TRUE(array.ok()) << array.status();
  return std::move(array).value();
}

template <class T>
std::vector<T> FromDevice(const DeviceArray<T>& array) {
  std::vector<T> values(array.size());
  EXPECT_TRUE(array.Read(values).ok());
  return values;
}

template <class T = float>
DeviceArray<T> Zeros(size_t count) {
  return ToDevice<T>(std::vector<T>(count, T(0)));
}

class StepOnDevice {
 public:
  StepOnDevice(const FieldModel& field, const StepInput& input)
      : input_(input), layout_(field.layout), hidden_(field.mlp.hidden), density_bias_(field.density_bias) {
    SliceState slice{.next = 0, .running = 77, .first_step = 0, .extent = {}, .grid = input.grid};
    std::ranges::copy(input.extent, slice.extent);
    slice_ = ToDevice<SliceState>(std::vector<SliceState>{slice});
    counters_ = ToDevice<StepCounters>(std::vector<StepCounters>{{0, 0, 0}});
    rays_ = ToDevice<Ray>(input.rays);
    // Uninitialized, which is NaN on the host: kernels must only read what an earlier kernel wrote.
    color_loss = DeviceArray<float>::Allocate(input.rays.size()).value();
    occupied_bits_ = ToDevice<uint32_t>(input.occupied_bits);
    cell_visits = Zeros<uint32_t>(kCells);
    cell_weight = Zeros<uint32_t>(kCells);
    layer_weight = Zeros<unsigned long long>(kLayers);
    table_ = ToDevice<float>(field.table.span());
    mlp_ = ToDevice<float>(field.mlp.parameters.span());
    table_gradient = Zeros(table_.size());
    step_blocks_ = StepBlocks(static_cast<int>(input.rays.size()), input.budget.max_samples);
    mlp_partial_ = DeviceArray<float>::Allocate(mlp_.size() * static_cast<size_t>(step_blocks_)).value();
  }

  StepParams Params() {
    return {.field = {layout_, table_.data(), mlp_.data(), hidden_, density_bias_},
            .slice = slice_.data(),
            .counters = counters_.data(),
            .rays = rays_.data(),
            .color_loss = color_loss.data(),
            .rays_per_step = static_cast<int>(input_.rays.size()),
            .budget = input_.budget,
            .loss_weights = input_.loss_weights,
            .gradient_cut = input_.gradient_cut,
            .occupied_bits = occupied_bits_.data(),
            .cell_visits = cell_visits.data(),
            .cell_weight = cell_weight.data(),
            .layer_weight = layer_weight.data(),
            .table_gradient = table_gradient.data(),
            .mlp_partial = mlp_partial_.data()};
  }

  void ComputeGradients(MlpPath path) {
    ASSERT_EQ(PrepareStep(Params(), path), cudaSuccess);
    ASSERT_EQ(LaunchGradients(Params(), path, nullptr), cudaSuccess);
    ASSERT_EQ(cudaDeviceSynchronize(), cudaSuccess);
  }

  // The sum over the blocks.
  std::vector<float> MlpGradient() const {
    const std::vector<float> partial = FromDevice(mlp_partial_);
    const size_t blocks = static_cast<size_t>(step_blocks_);
    std::vector<float> sums;
    for (size_t w = 0; w < mlp_.size(); ++w) {
      double sum = 0;
      for (size_t b = 0; b < blocks; ++b) sum += partial[w * blocks + b];
      sums.push_back(static_cast<float>(sum));
    }
    return sums;
  }

  StepCounters Counters() const { return FromDevice(counters_)[0]; }
  SliceState Slice() const { return FromDevice(slice_)[0]; }

  DeviceArray<float> table_gradient, color_loss;
  DeviceArray<uint32_t> cell_visits, cell_weight;
  DeviceArray<unsigned long long> layer_weight;

 private:
  StepInput input_;
  GridLayout layout_;
  int hidden_;
  float density_bias_;
  int step_blocks_ = 0;
  DeviceArray<SliceState> slice_;
  DeviceArray<StepCounters> counters_;
  DeviceArray<Ray> rays_;
  DeviceArray<uint32_t> occupied_bits_;
  DeviceArray<float> table_, mlp_, mlp_partial_;
};

}  // namespace romap::nerf::cuda
