#pragma once

// One training step by the CUDA kernels, on copies of what StepOnCpu has.

#include <gtest/gtest.h>

#include <vector>

#include "server/nerf/cuda/device_array.h"
#include "server/nerf/cuda/field_kernels.h"
#include "tests/unit/server/nerf_cuda/step_on_cpu.h"

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

inline DeviceArray<float> Zeros(size_t count) { return ToDevice<float>(std::vector<float>(count, 0.0f)); }

class StepOnDevice {
 public:
  StepOnDevice(const FieldModel& field, const StepInput& input, const StepOnCpu& cpu)
      : grid_(field.layout),
        hidden_(field.mlp.hidden),
        density_bias_(field.density_bias),
        count_(cpu.chunk.size),
        loss_weights_(input.loss_weights),
        gradient_cut_(input.gradient_cut),
        gradient_scale_(input.gradient_scale()) {
    const size_t n = static_cast<size_t>(count_);
    for (const AlignedBuffer<float>* array :
         {&cpu.chunk.x, &cpu.chunk.y, &cpu.chunk.z, &cpu.chunk.t, &cpu.chunk.length}) {
      inputs_.push_back(ToDevice<float>(array->span().first(n)));
    }
    for (const int width : {grid_.features, hidden_, 1, 1, 1, 1, 1, 1, 1, kOutputs, hidden_}) {
      // Uninitialised, which on the host means NaN: what a kernel reads, a kernel before it must have written.
      scratch_.push_back(DeviceArray<float>::Allocate(n * static_cast<size_t>(width)).value());
    }
    std::vector<RayTarget> targets;
    for (const Ray& ray : input.rays) targets.push_back(ray.target);
    spans_ = ToDevice<RaySpan>(cpu.spans);
    targets_ = ToDevice<RayTarget>(targets);
    results_ = ToDevice<RayResult>(std::vector<RayResult>(targets.size(), RayResult{}));
    table_ = ToDevice<float>(field.table.span());
    mlp_ = ToDevice<float>(field.mlp.parameters.span());
    for (DeviceArray<float>* a : {&table_gradient, &table_first_, &table_second_}) *a = Zeros(table_.size());
    for (DeviceArray<float>* a : {&mlp_gradient, &mlp_first_, &mlp_second_}) *a = Zeros(mlp_.size());
  }

  void ComputeGradients() {
    const FieldView field{grid_, table_.data(), mlp_.data(), hidden_, density_bias_};
    auto& in = inputs_;
    auto& out = scratch_;
    const SampleView samples{count_,        in[0].data(),  in[1].data(),  in[2].data(),  in[3].data(),  in[4].data(),
                             out[0].data(), out[1].data(), out[2].data(), out[3].data(), out[4].data(), out[5].data(),
                             out[6].data(), out[7].data(), out[8].data(), out[9].data(), out[10].data()};
    const CompositeParams composite{samples,         static_cast<int>(spans_.size()),
                                    spans_.data(),   targets_.data(),
                                    loss_weights_,   gradient_cut_,
                                    gradient_scale_, results_.data()};
    ASSERT_EQ(LaunchGradients({field, composite, table_gradient.data(), mlp_gradient.data()}, nullptr), cudaSuccess);
    ASSERT_EQ(cudaDeviceSynchronize(), cudaSuccess);
  }

  void Optimise(const AdamRates& rates) {
    const AdamParams table{
        rates, table_.size(), table_.data(), table_first_.data(), table_second_.data(), table_gradient.data()};
    const AdamParams mlp{rates, mlp_.size(), mlp_.data(), mlp_first_.data(), mlp_second_.data(), mlp_gradient.data()};
    ASSERT_EQ(LaunchAdam(table, nullptr), cudaSuccess);
    ASSERT_EQ(LaunchAdam(mlp, nullptr), cudaSuccess);
  }

  std::vector<RayResult> Results() const { return FromDevice(results_); }
  std::vector<float> Weights() const { return FromDevice(scratch_[7]); }

  DeviceArray<float> table_gradient, mlp_gradient;

 private:
  GridLayout grid_;
  int hidden_;
  float density_bias_;
  int count_;
  LossWeights loss_weights_;
  float gradient_cut_, gradient_scale_;
  std::vector<DeviceArray<float>> inputs_, scratch_;  // in the order of SampleView
  DeviceArray<RaySpan> spans_;
  DeviceArray<RayTarget> targets_;
  DeviceArray<RayResult> results_;
  DeviceArray<float> table_, mlp_, table_first_, table_second_, mlp_first_, mlp_second_;
};

}  // namespace romap::nerf::cuda
