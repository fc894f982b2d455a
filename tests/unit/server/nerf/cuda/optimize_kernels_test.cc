// OptimizeKernel and OccupancyKernel, run on the host in several orders of threads and compared with the CPU.
#include "tests/unit/server/nerf/cuda/device_test.h"
// The include above defines macros and must come first.
#include <array>
#include <bit>

#include "server/nerf/math/occupancy_rules.h"
#include "server/nerf/model/occupancy.h"
#include "tests/unit/server/nerf/cuda/step_on_cpu.h"
#include "tests/unit/server/nerf/cuda/step_on_device.h"

namespace romap::nerf::cuda::optimize_kernels_test {

using OptimizeKernelsTest = OrderedDeviceTest;
INSTANTIATE_TEST_SUITE_P(Orders, OptimizeKernelsTest, AllOrders(), OrderName);

AlignedBuffer<float> Noise(uint64_t stream, size_t count, float offset) {
  AlignedBuffer<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = RandomUniform(8, stream, i) + offset;
  return values;
}

// Parameters, moments and gradient on the CPU.
struct Adam {
  AlignedBuffer<float> parameters, first, second, gradient;
  Adam(uint64_t stream, size_t count)
      : parameters(Noise(stream, count, -0.5f)),
        first(Noise(stream + 1, count, -0.5f)),
        second(Noise(stream + 2, count, 0.0f)),
        gradient(Noise(stream + 3, count, -0.5f)) {}
};

constexpr int kSteps = 3;
constexpr uint32_t kRunning = 1;  // of kSteps

// A whole step whose rays all miss the box, so that only the values that the test puts into its arrays have an effect.
class OptimizeOnDevice {
 public:
  OptimizeOnDevice(const FieldModel& field, uint64_t first_step, const NerfConfig& config) {
    StepInput input = TestStep(20, {}, false);
    for (Ray& ray : input.rays) ray.origin[0] = 50.0f;
    step_ = std::make_unique<StepOnDevice>(field, input);
    SliceState slice = step_->Slice();
    slice.next = kRunning;
    slice.first_step = first_step;
    slice_ = ToDevice<SliceState>(std::vector<SliceState>{slice});
    rays_ = ToDevice<Ray>([&] {
      std::vector<Ray> rays;
      for (int i = 0; i < kSteps; ++i) rays.insert(rays.end(), input.rays.begin(), input.rays.end());
      return rays;
    }());
    color_loss_ = Zeros(rays_.size());
    rates_ = ToDevice<float>(std::vector<float>{0.5f, 0.01f, 0.7f});
    score = Zeros(kCells);
    hull_bits = Zeros<uint32_t>(kCells / 32);
    occupied_bits = Zeros<uint32_t>(kCells / 32);
    live_bits_ = DeviceArray<uint32_t>::Allocate(kCells / 32).value();
    plan_ = {static_cast<uint64_t>(config.occupancy_start_step),
             static_cast<uint64_t>(config.occupancy_interval_steps)};
    decay_ = static_cast<float>(config.occupancy_decay);
    threshold_ = static_cast<float>(config.occupancy_threshold);
  }

  StepLaunch Launch(DeviceArray<float>* table, DeviceArray<float>* mlp, DeviceArray<float>& partial, int blocks) {
    StepLaunch launch{.step = step_->Params(), .optimize = {}, .occupancy = {}};
    launch.step.slice = slice_.data();
    launch.step.rays = rays_.data();
    launch.step.color_loss = color_loss_.data();
    launch.optimize = {.slice = slice_.data(),
                       .learning_rate = rates_.data(),
                       .beta1 = 0.8f,
                       .beta2 = 0.95f,
                       .table_count = table[0].size(),
                       .table = table[0].data(),
                       .table_first = table[1].data(),
                       .table_second = table[2].data(),
                       .table_gradient = table[3].data(),
                       .mlp_count = static_cast<int>(mlp[0].size()),
                       .mlp = mlp[0].data(),
                       .mlp_first = mlp[1].data(),
                       .mlp_second = mlp[2].data(),
                       .mlp_partial = partial.data(),
                       .step_blocks = blocks,
                       .score = score.data(),
                       .cell_visits = step_->cell_visits.data(),
                       .cell_weight = step_->cell_weight.data(),
                       .decay = decay_,
                       .threshold = threshold_,
                       .plan = plan_,
                       .hull_bits = hull_bits.data(),
                       .live_bits = live_bits_.data()};
    launch.occupancy = {.slice = slice_.data(),
                        .plan = plan_,
                        .live_bits = live_bits_.data(),
                        .hull_bits = hull_bits.data(),
                        .occupied_bits = occupied_bits.data(),
                        .layer_weight = step_->layer_weight.data()};
    return launch;
  }

  void Run(const StepLaunch& launch) {
    ASSERT_EQ(PrepareStep(launch.step, MlpPath::kFloat), cudaSuccess);
    ASSERT_EQ(LaunchStep(launch, MlpPath::kFloat, nullptr), cudaSuccess);
    ASSERT_EQ(cudaDeviceSynchronize(), cudaSuccess);
  }

  StepOnDevice& step() { return *step_; }
  SliceState Slice() const { return FromDevice(slice_)[0]; }
  DeviceArray<float> score;
  DeviceArray<uint32_t> hull_bits, occupied_bits;

 private:
  std::unique_ptr<StepOnDevice> step_;
  DeviceArray<SliceState> slice_;
  DeviceArray<Ray> rays_;
  DeviceArray<float> color_loss_, rates_;
  DeviceArray<uint32_t> live_bits_;
  OccupancyPlan plan_{};
  float decay_ = 0, threshold_ = 0;
};

std::array<DeviceArray<float>, 4> AdamOnDevice(const Adam& adam) {
  return {ToDevice<float>(adam.parameters.span()), ToDevice<float>(adam.first.span()),
          ToDevice<float>(adam.second.span()), ToDevice<float>(adam.gradient.span())};
}

TEST_P(OptimizeKernelsTest, ParametersEqualThoseOfTheCpu) {
  constexpr size_t kTable = 400, kMlp = 331;  // not multiples of the block size
  constexpr int kBlocks = 37;                 // not a multiple of the warp size
  Adam table(10, kTable), mlp(20, kMlp);
  for (size_t i = 100; i < 200; ++i) table.gradient[i] = 0.0f;
  auto device_table = AdamOnDevice(table), device_mlp = AdamOnDevice(mlp);
  // The gradient of each weight as a sum over the blocks.
  std::vector<float> partial;
  for (size_t w = 0; w < kMlp; ++w) {
    float left = mlp.gradient[w];
    for (int b = 0; b + 1 < kBlocks; ++b) {
      partial.push_back(RandomUniform(9, w, static_cast<uint64_t>(b)) - 0.5f);
      left -= partial.back();
    }
    partial.push_back(left);
  }
  DeviceArray<float> device_partial = ToDevice<float>(partial);
  OptimizeOnDevice device(NoisyField(2, 16), 100, NerfConfig{});
  // Uses these partial sums instead of those of the first launch.
  StepLaunch launch = device.Launch(device_table.data(), device_mlp.data(), device_partial, kBlocks);
  device.Run(launch);

  const AdamRates rates{0.01f, 0.8f, 0.95f};  // the learning rate of step kRunning
  for (Adam* adam : {&table, &mlp}) {
    float* gradient = adam->gradient.data();
    PlainKernels().adam(rates, 0, adam->parameters.size(), adam->parameters.data(), adam->first.data(),
                        adam->second.data(), &gradient, 1);
  }
  EXPECT_EQ(Difference(table.parameters.span(), FromDevice(device_table[0]), 1e-6), "");
  EXPECT_EQ(Difference(table.first.span(), FromDevice(device_table[1]), 1e-6), "");
  EXPECT_EQ(Difference(table.second.span(), FromDevice(device_table[2]), 1e-6), "");
  EXPECT_EQ(FromDevice(device_table[3]), std::vector<float>(kTable, 0.0f));
  EXPECT_EQ(Difference(mlp.parameters.span(), FromDevice(device_mlp[0]), 1e-5), "");
  EXPECT_EQ(Difference(mlp.first.span(), FromDevice(device_mlp[1]), 1e-5), "");
  EXPECT_EQ(Difference(mlp.second.span(), FromDevice(device_mlp[2]), 1e-5), "");
  EXPECT_EQ(device.Slice().running, kRunning);
  EXPECT_EQ(device.Slice().next, kRunning + 1);
}

// Random scores, hull and visits, denser at the borders of the grid, where cells have fewer neighbors.
struct Cells {
  std::vector<uint8_t> hull = std::vector<uint8_t>(kCells);
  std::vector<float> score = std::vector<float>(kCells), weight = std::vector<float>(kCells);
  std::vector<uint32_t> visits = std::vector<uint32_t>(kCells);

  Cells() {
    for (size_t i = 0; i < kCells; ++i) {
      const auto inner = [](size_t x) { return x > 1 && x < 62; };
      const bool rare = inner(i % 64) && inner(i / 64 % 64) && inner(i / 4096);
      hull[i] = RandomUniform(4, 0, i) < 0.7f;
      score[i] = RandomUniform(4, 1, i) < (rare ? 0.02f : 0.3f) ? RandomUniform(4, 2, i) * 0.02f : 0.0f;
      if (RandomUniform(4, 3, i) > (rare ? 0.005f : 0.1f)) continue;
      visits[i] = 1 + static_cast<uint32_t>(RandomBits(4, 4, i) % 3);
      weight[i] = RandomUniform(4, 5, i) < 0.5f ? 0.0f : RandomUniform(4, 6, i) * 0.03f;
    }
  }
};

std::vector<uint32_t> Pack(const std::vector<uint8_t>& cells) {
  std::vector<uint32_t> bits(cells.size() / 32);
  for (size_t i = 0; i < cells.size(); ++i) bits[i / 32] |= uint32_t{cells[i]} << (i % 32);
  return bits;
}

TEST_P(OptimizeKernelsTest, ScoresAndOccupiedCellsEqualThoseOfTheCpu) {
  NerfConfig config;
  config.occupancy_start_step = 40;
  config.occupancy_interval_steps = 20;
  const Cells cells;
  for (const uint64_t done : {59, 60}) {  // the occupied cells change after 60 steps, not after 59
    Occupancy occupancy(config);
    Occupancy::State state = occupancy.state();
    state.score = cells.score;
    std::ranges::fill(state.bits, 0u);
    occupancy.SetState(state);
    for (size_t i = 0; i < kCells; ++i) {  // the largest weight comes last, so that the order has no effect
      for (uint32_t visit = 1; visit < cells.visits[i]; ++visit) occupancy.Record(static_cast<uint32_t>(i), 0.0f);
      if (cells.visits[i] > 0) occupancy.Record(static_cast<uint32_t>(i), cells.weight[i]);
    }
    if (done == 60) occupancy.SetHull(cells.hull);
    state = occupancy.state();

    Adam none(30, 16);
    auto table = AdamOnDevice(none), mlp = AdamOnDevice(none);
    DeviceArray<float> partial = Zeros(16);
    OptimizeOnDevice device(NoisyField(2, 16), done - kRunning - 1, config);
    device.score = ToDevice<float>(cells.score);
    device.hull_bits = ToDevice<uint32_t>(Pack(cells.hull));
    device.step().cell_visits = ToDevice<uint32_t>(cells.visits);
    std::vector<uint32_t> weight_bits;
    for (const float weight : cells.weight) weight_bits.push_back(std::bit_cast<uint32_t>(weight));
    device.step().cell_weight = ToDevice<uint32_t>(weight_bits);
    device.step().layer_weight = ToDevice<unsigned long long>(std::vector<unsigned long long>(kLayers, 10));
    device.Run(device.Launch(table.data(), mlp.data(), partial, 1));

    EXPECT_EQ(Difference(state.score, FromDevice(device.score), 1e-6), "");
    EXPECT_EQ(FromDevice(device.occupied_bits), state.bits) << done;
    EXPECT_EQ(FromDevice(device.step().cell_visits), std::vector<uint32_t>(kCells, 0));
    EXPECT_EQ(FromDevice(device.step().cell_weight), std::vector<uint32_t>(kCells, 0));
    EXPECT_EQ(FromDevice(device.step().layer_weight), std::vector<unsigned long long>(kLayers, done == 60 ? 5 : 10));
  }
}

}  // namespace romap::nerf::cuda::optimize_kernels_test
