// The CUDA kernels, run on the host in every order of threads, against the CPU's kernels.
// clang-format off
#include "tests/support/cuda_on_host/cuda_on_host.h"
// clang-format on

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <limits>
#include <numeric>

#include "server/nerf/cuda/cuda_field.h"
#include "tests/support/cuda_on_host/race_checker.h"
#include "tests/unit/server/nerf_cuda/step_on_cpu.h"
#include "tests/unit/server/nerf_cuda/step_on_device.h"

namespace romap::nerf::cuda {
namespace {

using cuda_on_host::RunOptions;
using cuda_on_host::SetDeviceTraits;
using cuda_on_host::SetRunOptions;
using cuda_on_host::ThreadOrder;

// The same formulas in the same precision: only the order of sums differs. Against vectors, cells of the finest level
// magnify the rounding of positions, as between the CPU's own kernels.
constexpr double kPlainTolerance = 2e-5;
constexpr double kSimdTolerance = 2e-3;

class CudaKernelsTest : public testing::TestWithParam<RunOptions> {
 protected:
  void SetUp() override {
    SetRunOptions(GetParam());
    SetDeviceTraits({});
  }
  void TearDown() override {
    EXPECT_EQ(cudaGetLastError(), cudaSuccess);
#ifdef ROMAP_TEST_FINDS_RACES
    EXPECT_EQ(cuda_on_host::RaceCount(), 0) << cuda_on_host::FirstRace();
    cuda_on_host::ResetRaces();
#endif
  }
};

INSTANTIATE_TEST_SUITE_P(Orders, CudaKernelsTest,
                         testing::Values(RunOptions{ThreadOrder::kForward}, RunOptions{ThreadOrder::kReverse},
                                         RunOptions{ThreadOrder::kShuffled, 3},
                                         RunOptions{ThreadOrder::kShuffled, 4, 2, true}),
                         [](const auto& info) { return fmt::format("Order{}", info.index); });

std::vector<float> EvaluateOnCpu(const KernelTable& kernels, const FieldModel& field, const SampleChunk& points) {
  const int n = points.size;
  SampleChunk c(n, field.layout.features, field.mlp.hidden);
  c.size = n;
  kernels.encode(field.layout, field.table.data(), n, points.x.data(), points.y.data(), points.z.data(),
                 c.features.data());
  kernels.mlp_forward(field.mlp, n, c.features.data(), c.hidden.data(), c.raw.data());
  kernels.activate(c, field.density_bias);
  std::vector<float> value;
  for (size_t i = 0; i < static_cast<size_t>(n); ++i) {
    value.insert(value.end(), {c.red[i], c.green[i], c.blue[i], c.raw[kOutputs * i + 3] + field.density_bias});
  }
  return value;
}

TEST_P(CudaKernelsTest, FieldHasTheValuesOfTheCpu) {
  constexpr size_t kPoints = 301;  // no multiple of a block
  SampleChunk points(kPoints, 16, 16);
  points.size = kPoints;
  for (size_t i = 0; i < kPoints; ++i) {
    points.x[i] = i < 2 ? static_cast<float>(i) : RandomUniform(1, 0, i);
    points.y[i] = i < 2 ? static_cast<float>(i) : RandomUniform(1, 1, i);
    points.z[i] = i < 2 ? static_cast<float>(i) : RandomUniform(1, 2, i);
  }
  for (const auto& [levels, hidden] : {std::pair(3, 16), std::pair(8, 32), std::pair(16, 128)}) {
    const FieldModel field = NoisyField(levels, hidden);
    const auto device = CudaField::Create(field);
    ASSERT_TRUE(device.ok()) << device.status();
    const auto got = device->Evaluate(points.x.span().first(kPoints), points.y.span().first(kPoints),
                                      points.z.span().first(kPoints));
    ASSERT_TRUE(got.ok()) << got.status();
    EXPECT_EQ(Difference(EvaluateOnCpu(PlainKernels(), field, points), *got, kPlainTolerance), "") << levels;
    EXPECT_EQ(Difference(EvaluateOnCpu(SimdKernels(), field, points), *got, kSimdTolerance), "") << levels;
  }
}

TEST_P(CudaKernelsTest, StepHasTheGradientsOfTheCpu) {
  for (const bool random_background : {false, true}) {
    const FieldModel field = NoisyField(random_background ? 8 : 5, 32);
    const StepInput input = TestStep(70, random_background);
    StepOnCpu plain(field, input), simd(field, input);
    StepOnDevice device(field, input, plain);
    plain.Run(PlainKernels(), field, input);
    simd.Run(SimdKernels(), field, input);
    device.ComputeGradients();

    const size_t table = field.table.size(), samples = static_cast<size_t>(plain.chunk.size);
    EXPECT_GT(plain.cut_samples, 5);
    EXPECT_LT(plain.cut_samples, plain.chunk.size / 2);
    EXPECT_LT(samples, 70u * 12u);  // some rays miss
    const std::vector<float> table_gradient = FromDevice(device.table_gradient);
    const std::vector<float> mlp_gradient = FromDevice(device.mlp_gradient);
    EXPECT_EQ(Difference(plain.table_gradient.span().first(table), table_gradient, kPlainTolerance), "");
    EXPECT_EQ(Difference(simd.table_gradient.span().first(table), table_gradient, kSimdTolerance), "");
    EXPECT_EQ(Difference(plain.mlp_gradient.span(), mlp_gradient, kPlainTolerance), "");
    EXPECT_EQ(Difference(simd.mlp_gradient.span(), mlp_gradient, kSimdTolerance), "");
    EXPECT_EQ(Difference(plain.chunk.weight.span().first(samples), device.Weights(), kPlainTolerance), "");
    std::vector<float> want, got;
    for (const RayResult& result : plain.results) want.insert(want.end(), {result.loss, result.opacity});
    for (const RayResult& result : device.Results()) got.insert(got.end(), {result.loss, result.opacity});
    EXPECT_EQ(Difference(want, got, kPlainTolerance), "");
  }
}

TEST_P(CudaKernelsTest, AdamMovesParametersAsTheCpu) {
  constexpr size_t kCount = 400;
  const auto noise = [](uint64_t stream) {
    AlignedBuffer<float> values(kCount);
    for (size_t i = 0; i < kCount; ++i) values[i] = RandomUniform(8, stream, i) - 0.5f;
    return values;
  };
  AlignedBuffer<float> parameters = noise(0), first = noise(1), second = noise(2), gradient = noise(3);
  for (size_t i = 0; i < kCount; ++i) second[i] += 0.5f;
  for (size_t i = 100; i < 200; ++i) gradient[i] = 0.0f;
  DeviceArray<float> device[] = {ToDevice(parameters.span()), ToDevice(first.span()), ToDevice(second.span()),
                                 ToDevice(gradient.span())};
  const AdamRates rates{0.01f, 0.8f, 0.95f};
  const AdamParams params{rates, kCount, device[0].data(), device[1].data(), device[2].data(), device[3].data()};
  ASSERT_EQ(LaunchAdam(params, nullptr), cudaSuccess);
  float* gradients = gradient.data();
  PlainKernels().adam(rates, 0, kCount, parameters.data(), first.data(), second.data(), &gradients, 1);
  EXPECT_EQ(Difference(parameters.span(), FromDevice(device[0]), 1e-6), "");
  EXPECT_EQ(Difference(first.span(), FromDevice(device[1]), 1e-6), "");
  EXPECT_EQ(Difference(second.span(), FromDevice(device[2]), 1e-6), "");
  EXPECT_EQ(FromDevice(device[3]), std::vector<float>(kCount, 0.0f));
}

TEST_P(CudaKernelsTest, StepsLearnAsFastAsOnTheCpu) {
  constexpr int kSteps = 8;
  FieldModel field = NoisyField(4, 16);
  const StepInput input = TestStep(60, false);
  StepOnCpu cpu(field, input);
  StepOnDevice device(field, input, cpu);
  const AdamRates rates{0.02f, 0.8f, 0.95f};
  AlignedBuffer<float> table_first(field.table.size()), table_second(field.table.size());
  AlignedBuffer<float> mlp_first(field.mlp.parameters.size()), mlp_second(field.mlp.parameters.size());
  const auto loss = [](const std::vector<RayResult>& results) {
    return std::accumulate(results.begin(), results.end(), 0.0,
                           [](double sum, const RayResult& r) { return sum + r.loss; });
  };
  double first_loss = 0;
  for (int step = 0; step < kSteps; ++step) {
    cpu.Run(PlainKernels(), field, input);
    float* table_gradient = cpu.table_gradient.data();
    float* mlp_gradient = cpu.mlp_gradient.data();
    PlainKernels().adam(rates, 0, field.table.size(), field.table.data(), table_first.data(), table_second.data(),
                        &table_gradient, 1);
    PlainKernels().adam(rates, 0, field.mlp.parameters.size(), field.mlp.parameters.data(), mlp_first.data(),
                        mlp_second.data(), &mlp_gradient, 1);
    field.mlp.UpdateTransposed();
    device.ComputeGradients();
    device.Optimise(rates);
    if (step == 0) first_loss = loss(device.Results());
  }
  const double last_loss = loss(device.Results());
  EXPECT_LT(last_loss, 0.9 * first_loss);
  EXPECT_NEAR(last_loss, loss(cpu.results), 0.01 * first_loss);
}

// ----------------------------------------------------------------------------------------------------- what goes wrong

class CudaFieldTest : public testing::Test {
 protected:
  void SetUp() override { SetDeviceTraits({}); }
  void TearDown() override { SetDeviceTraits({}); }
};

TEST_F(CudaFieldTest, DevicesAreFoundAndTried) {
  const auto devices = ProbeDevices();
  ASSERT_TRUE(devices.ok()) << devices.status();
  EXPECT_EQ(*devices, 1);
}

TEST_F(CudaFieldTest, NoDeviceIsSaidInOneLine) {
  SetDeviceTraits({.devices = 0});
  const auto devices = ProbeDevices();
  EXPECT_EQ(devices.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(Message(devices.status()), "CUDA: cannot find a device: no CUDA-capable device is detected");
}

TEST_F(CudaFieldTest, TooLittleMemoryIsSaidAndGivenBack) {
  const size_t before = cuda_on_host::AllocatedBytes();
  const FieldModel field = NoisyField(8, 32);
  SetDeviceTraits({.memory_bytes = before + field.table.size() * sizeof(float)});
  const auto device = CudaField::Create(field);
  EXPECT_EQ(Message(device.status()), "CUDA: cannot allocate memory: out of memory");
  EXPECT_EQ(cuda_on_host::AllocatedBytes(), before);
}

TEST_F(CudaFieldTest, TooWideAFieldAndUnequalCoordinatesAreRefused) {
  EXPECT_EQ(CudaField::Create(NoisyField(2, 144)).status().code(), absl::StatusCode::kInvalidArgument);
  const auto device = CudaField::Create(NoisyField(2, 16));
  ASSERT_TRUE(device.ok());
  const std::vector<float> three(3, 0.5f), two(2, 0.5f);
  EXPECT_EQ(Message(device->Evaluate(three, two, three).status()),
            "CUDA: 3 x, 2 y and 3 z coordinates; there must be as many of each");
  EXPECT_TRUE(device->Evaluate({}, {}, {})->empty());
}

TEST(DifferenceTest, IsSeenAlsoWhenNotANumber) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> values = {1, 2, 3};
  EXPECT_EQ(Difference(values, values, 1e-6), "");
  EXPECT_NE(Difference(values, std::vector<float>{1, 2, 3.1f}, 1e-2), "");
  EXPECT_NE(Difference(values, std::vector<float>{1, nan, 3}, 1e-2), "");
  EXPECT_NE(Difference(std::vector<float>{1, nan, 3}, std::vector<float>{1, nan, 3}, 1e-2), "");
  EXPECT_NE(Difference(values, std::vector<float>{1, 2}, 1e-2), "");
}

}  // namespace
}  // namespace romap::nerf::cuda
