// StepKernel and EvaluateKernel, run on the host in several orders of threads and compared with the kernels of the CPU.
#include "tests/unit/server/nerf/cuda/device_test.h"
// The include above defines macros and must come first.
#include <bit>
#include <limits>

#include "server/nerf/cuda/cuda_field.h"
#include "tests/unit/server/nerf/cuda/step_on_cpu.h"
#include "tests/unit/server/nerf/cuda/step_on_device.h"

namespace romap::nerf::cuda::step_kernel_test {

// kPlain: same formulas and precision, only the order of sums differs. kRounded: sums halfway between two halves may be
// rounded to either one. kSimd: cells of the finest level amplify the rounding of positions, as between the kernels of
// the CPU. kHalf: neurons near 0 may be active with halves and inactive with floats.
#ifndef ROMAP_TEST_ON_DEVICE
constexpr double kPlainTolerance = 2e-5;
constexpr double kRoundedTolerance = 5e-4;
constexpr double kCountTolerance = 0;
#else
// Devices fuse multiplications and additions, so points at the border of a cell may fall on the other side.
constexpr double kPlainTolerance = 2e-3;
constexpr double kRoundedTolerance = 2e-2;
constexpr double kCountTolerance = 0.01;
#endif
constexpr double kSimdTolerance = 2e-3;
constexpr double kHalfTolerance = 4e-3;

void ExpectCount(unsigned long long got, double want) {
  EXPECT_NEAR(static_cast<double>(got), want, kCountTolerance * want);
}

using CudaKernelsTest = OrderedDeviceTest;
INSTANTIATE_TEST_SUITE_P(Orders, CudaKernelsTest, AllOrders(), OrderName);

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
  constexpr size_t kPoints = 131;  // not a multiple of the block size
  SampleChunk points(kPoints, 16, 16);
  points.size = kPoints;
  for (size_t i = 0; i < kPoints; ++i) {
    points.x[i] = i < 2 ? static_cast<float>(i) : RandomUniform(1, 0, i);
    points.y[i] = i < 2 ? static_cast<float>(i) : RandomUniform(1, 1, i);
    points.z[i] = i < 2 ? static_cast<float>(i) : RandomUniform(1, 2, i);
  }
  for (const auto& [levels, hidden] : {std::pair(3, 16), std::pair(9, 48), std::pair(16, 128)}) {
    const FieldModel field = NoisyField(levels, hidden);
    const auto device = CudaField::Create(field);
    ASSERT_TRUE(device.ok()) << device.status();
    const auto evaluate = [&](MlpPath path) {
      const auto got = device->Evaluate(points.x.span().first(kPoints), points.y.span().first(kPoints),
                                        points.z.span().first(kPoints), path);
      EXPECT_TRUE(got.ok()) << got.status();
      return got.value_or(std::vector<float>{});
    };
    const std::vector<float> got = evaluate(MlpPath::kFloat);
    EXPECT_EQ(Difference(EvaluateOnCpu(PlainKernels(), field, points), got, kPlainTolerance), "") << levels;
    EXPECT_EQ(Difference(EvaluateOnCpu(SimdKernels(), field, points), got, kSimdTolerance), "") << levels;
    EXPECT_EQ(Difference(got, evaluate(MlpPath::kTensorCores), kHalfTolerance), "") << levels;
  }
}

struct Shape {
  int levels, hidden, rays;
  SampleBudget budget;
  bool random_background;
};

// Partly filled tiles, tiles of many and of two rays, rays that span warps, fields that need padding.
const Shape kShapes[] = {
    {5, 32, 23, {.finest_step = 0.02f, .min_samples = 3, .max_samples = 12}, false},
    {8, 32, 17, {.finest_step = 0.01f, .min_samples = 4, .max_samples = 16}, true},
    {16, 64, 5, {.finest_step = 0.02f, .min_samples = 4, .max_samples = 32, .skip_empty = false}, false},
    {9, 48, 3, {.finest_step = 0.004f, .min_samples = 4, .max_samples = 64}, false},
    {2, 16, 131, {.finest_step = 0.01f, .min_samples = 1, .max_samples = 1}, true},
};

TEST_P(CudaKernelsTest, StepHasTheGradientsOfTheCpu) {
  for (const Shape& shape : kShapes) {
    SCOPED_TRACE(fmt::format("{} levels, {} neurons, {} rays", shape.levels, shape.hidden, shape.rays));
    const FieldModel field = NoisyField(shape.levels, shape.hidden);
    const StepInput input = TestStep(shape.rays, shape.budget, shape.random_background);
    for (const MlpPath path : {MlpPath::kFloat, MlpPath::kTensorCores}) {
      const bool plain = path == MlpPath::kFloat;
      const double tolerance = plain ? kPlainTolerance : kRoundedTolerance;
      StepOnCpu cpu(field, input);
      plain ? cpu.Run(PlainKernels(), field, input) : cpu.RunRounded(field, input);
      ASSERT_GT(cpu.active_samples, cpu.chunk.size / 10);
      ASSERT_TRUE(cpu.active_samples < cpu.chunk.size || shape.budget.max_samples == 1);
      const std::span<const float> table_gradient = cpu.table_gradient.span().first(field.table.size());
      StepOnDevice device(field, input);
      device.ComputeGradients(path);
      EXPECT_EQ(Difference(table_gradient, FromDevice(device.table_gradient), tolerance), "");
      EXPECT_EQ(Difference(cpu.mlp_gradient.span(), device.MlpGradient(), tolerance), "");
      EXPECT_EQ(Difference(cpu.ColorLosses(input), FromDevice(device.color_loss), tolerance), "");
      const StepCounters counters = device.Counters();
      ExpectCount(counters.samples, cpu.chunk.size);
      ExpectCount(counters.rays,
                  static_cast<double>(std::ranges::count_if(cpu.spans, [](RaySpan span) { return span.count > 0; })));
      ExpectCount(counters.active_samples, cpu.active_samples);
      EXPECT_EQ(device.Slice().running, 0u);
      EXPECT_EQ(device.Slice().next, 0u);  // the last launch of a step increments it
    }
  }
}

TEST_P(CudaKernelsTest, StepRecordsTheWeightsOfItsSamples) {
  const FieldModel field = NoisyField(5, 16);
  const StepInput input = TestStep(60, {.finest_step = 0.02f, .min_samples = 4, .max_samples = 14}, false);
  StepOnCpu cpu(field, input);
  cpu.Run(PlainKernels(), field, input);
  std::vector<uint32_t> visits(kCells);
  std::vector<float> weight(kCells), layers(kLayers);
  for (size_t i = 0; i < static_cast<size_t>(cpu.chunk.size); ++i) {
    const uint32_t cell = cpu.chunk.cell[i];
    ++visits[cell];
    weight[cell] = std::max(weight[cell], cpu.chunk.weight[i]);
    layers[cell % 64] += cpu.chunk.weight[i];
    layers[64 + cell / 64 % 64] += cpu.chunk.weight[i];
    layers[128 + cell / 4096] += cpu.chunk.weight[i];
  }
  StepOnDevice device(field, input);
  device.ComputeGradients(MlpPath::kFloat);
  std::vector<float> got;
  for (const uint32_t bits : FromDevice(device.cell_weight)) got.push_back(std::bit_cast<float>(bits));
#ifndef ROMAP_TEST_ON_DEVICE
  EXPECT_EQ(FromDevice(device.cell_visits), visits);
  EXPECT_EQ(Difference(weight, got, kPlainTolerance), "");
#endif
  got.clear();
  for (const unsigned long long units : FromDevice(device.layer_weight)) {
    got.push_back(static_cast<float>(units) * kLayerUnit);
  }
  EXPECT_EQ(Difference(layers, got, kPlainTolerance), "");
}

// With more tiles than blocks, a block processes a second tile.
TEST_P(CudaKernelsTest, BlocksProcessSeveralTiles) {
  const FieldModel field = NoisyField(2, 16);
  const StepInput input =
      TestStep(2 * kMaxStepBlocks + 7, {.finest_step = 0.9f, .min_samples = 1, .max_samples = 64}, false);
  ASSERT_EQ(StepBlocks(static_cast<int>(input.rays.size()), input.budget.max_samples), kMaxStepBlocks);
  StepOnCpu cpu(field, input);
  cpu.Run(PlainKernels(), field, input);
  StepOnDevice device(field, input);
  device.ComputeGradients(MlpPath::kFloat);
  EXPECT_EQ(Difference(cpu.table_gradient.span().first(field.table.size()), FromDevice(device.table_gradient),
                       kPlainTolerance),
            "");
  EXPECT_EQ(Difference(cpu.mlp_gradient.span(), device.MlpGradient(), kPlainTolerance), "");
  EXPECT_EQ(Difference(cpu.ColorLosses(input), FromDevice(device.color_loss), kPlainTolerance), "");
}

// Derivatives far below and far above the range of a half keep their precision.
TEST_P(CudaKernelsTest, TensorCoresKeepSmallAndLargeDerivatives) {
  const FieldModel field = NoisyField(8, 32);
  for (const float factor : {1e-7f, 1e6f}) {
    StepInput input = TestStep(30, {}, false);
    input.gradient_cut = 0;
    LossWeights& w = input.loss_weights;
    w = {.opacity_object = factor, .opacity_background = factor, .density = 0.01f * factor};
    for (Ray& ray : input.rays) ray.target.is_object = false;  // so that only these weights determine the derivatives
    StepOnCpu cpu(field, input);
    cpu.RunRounded(field, input);
    StepOnDevice device(field, input);
    device.ComputeGradients(MlpPath::kTensorCores);
    EXPECT_EQ(Difference(cpu.table_gradient.span().first(field.table.size()), FromDevice(device.table_gradient),
                         kRoundedTolerance),
              "");
    EXPECT_EQ(Difference(cpu.mlp_gradient.span(), device.MlpGradient(), kRoundedTolerance), "");
  }
}

TEST_P(CudaKernelsTest, NanReachesTheGradients) {
  const FieldModel field = NoisyField(8, 32);
  StepInput input = TestStep(20, {}, false);
  for (Ray& ray : input.rays) ray.target.rgb[1] = std::numeric_limits<float>::quiet_NaN();
  for (const MlpPath path : {MlpPath::kFloat, MlpPath::kTensorCores}) {
    StepOnDevice device(field, input);
    device.ComputeGradients(path);
    EXPECT_TRUE(std::ranges::any_of(device.MlpGradient(), [](float x) { return std::isnan(x); }));
    EXPECT_TRUE(std::ranges::any_of(FromDevice(device.color_loss), [](float x) { return std::isnan(x); }));
  }
}

// The largest field of the configuration fits into the shared memory of every device since compute capability 8.0.
TEST_P(CudaKernelsTest, TheLargestFieldFitsIntoABlock) {
  const FieldModel field = NoisyField(16, kMaxHidden);
  StepOnDevice device(field, TestStep(8, {}, false));
  for (const int most : {1, 16, 64}) {
    StepParams params = device.Params();
    params.budget.max_samples = most;
    EXPECT_EQ(PrepareStep(params, MlpPath::kTensorCores), cudaSuccess) << most;
  }
}

TEST(DifferenceTest, DetectsDifferencesAndNan) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<float> values = {1, 2, 3};
  EXPECT_EQ(Difference(values, values, 1e-6), "");
  EXPECT_NE(Difference(values, std::vector<float>{1, 2, 3.1f}, 1e-2), "");
  EXPECT_NE(Difference(values, std::vector<float>{1, nan, 3}, 1e-2), "");
  EXPECT_NE(Difference(std::vector<float>{1, nan, 3}, std::vector<float>{1, nan, 3}, 1e-2), "");
  EXPECT_NE(Difference(values, std::vector<float>{1, 2}, 1e-2), "");
}

}  // namespace romap::nerf::cuda::step_kernel_test
