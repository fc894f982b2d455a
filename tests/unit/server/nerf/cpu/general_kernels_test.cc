// The frequency encoding and MLPs of several hidden layers: compared with exact values, with central differences, and
// every instruction set with the plain form.
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "server/nerf/cpu/cpu_trainer.h"
#include "server/nerf/cpu/kernels.h"
#include "server/nerf/math/random.h"

namespace romap::nerf::general_kernels_test {

constexpr int kPoints = 101;  // not a multiple of any vector, tile or block size

float Noise(uint64_t stream, uint64_t i) { return 2.0f * RandomUniform(21, stream, i) - 1.0f; }

AlignedBuffer<float> NoiseBuffer(size_t count, uint64_t stream, float scale = 1.0f) {
  AlignedBuffer<float> buffer(count);
  for (size_t i = 0; i < count; ++i) buffer[i] = scale * Noise(stream, i);
  return buffer;
}

FieldModel FrequencyModel(int octaves, int width, int layers) {
  NerfConfig config;
  config.encoding = "frequency";
  config.levels = octaves;
  config.hidden_width = width;
  config.hidden_layers = layers;
  return FieldModel(config, 3);
}

struct Positions {
  AlignedBuffer<float> x{kPoints}, y{kPoints}, z{kPoints};
  Positions() {
    for (size_t i = 0; i < kPoints; ++i) {  // an enlarged box extends beyond 0..1
      x[i] = 1.5f * RandomUniform(22, 0, i) - 0.25f;
      y[i] = RandomUniform(22, 1, i);
      z[i] = RandomUniform(22, 2, i);
    }
    x[0] = y[0] = z[0] = 0.0f;
    x[1] = y[1] = z[1] = 1.0f;
  }
};

AlignedBuffer<float> Encode(const KernelTable& kernels, const FieldModel& model, const Positions& at) {
  AlignedBuffer<float> features(size_t{kPoints} * static_cast<unsigned>(model.layout.features));
  kernels.For(model).encode(model.layout, model.table.data(), kPoints, at.x.data(), at.y.data(), at.z.data(),
                            features.data());
  return features;
}

// Raw outputs, and the gradients of sum d_raw * raw.
struct MlpRun {
  AlignedBuffer<float> raw, d_inputs, gradient;
};

MlpRun RunMlp(const KernelTable& table, const FieldModel& model, const AlignedBuffer<float>& inputs,
              const AlignedBuffer<float>& d_raw) {
  const KernelTable& kernels = table.For(model);
  MlpRun run{AlignedBuffer<float>(kPoints * kOutputs), inputs.Clone(),
             AlignedBuffer<float>(model.mlp.parameters.size())};
  AlignedBuffer<float> hidden(static_cast<size_t>(kPoints * model.mlp.hidden));
  kernels.mlp_forward(model.mlp, kPoints, run.d_inputs.data(), hidden.data(), run.raw.data());
  kernels.mlp_backward(model.mlp, kPoints, run.d_inputs.data(), hidden.data(), d_raw.data(), run.gradient.data());
  return run;
}

TEST(FrequencyEncodingTest, IsSinesAndCosinesOfEveryOctave) {
  constexpr int kOctaves = 10;
  const FieldModel model = FrequencyModel(kOctaves, 16, 1);
  ASSERT_EQ(model.layout.features, 64);
  EXPECT_EQ(model.table.size(), 0u);
  const Positions at;
  const AlignedBuffer<float> features = Encode(PlainKernels(), model, at);
  for (size_t i = 0; i < kPoints; ++i) {
    const float* row = features.data() + 64 * i;
    const float p[3] = {at.x[i], at.y[i], at.z[i]};
    for (int axis = 0; axis < 3; ++axis) {
      for (int k = 0; k < kOctaves; ++k) {
        const double angle = std::numbers::pi * std::ldexp(static_cast<double>(p[axis]), k);
        ASSERT_NEAR(row[2 * (axis * kOctaves + k)], std::sin(angle), 4e-6) << "point " << i << " octave " << k;
        ASSERT_NEAR(row[2 * (axis * kOctaves + k) + 1], std::cos(angle), 4e-6) << "point " << i << " octave " << k;
      }
      EXPECT_EQ(row[60 + axis], p[axis]);
    }
    EXPECT_EQ(row[63], 1.0f);
  }
}

TEST(FrequencyEncodingTest, FeaturesBeyondTheEncodingAreZero) {
  const FieldModel model = FrequencyModel(3, 16, 1);
  ASSERT_EQ(model.layout.features, 32);
  const AlignedBuffer<float> features = Encode(SimdKernels(), model, Positions());
  for (size_t i = 0; i < kPoints; ++i) {
    EXPECT_EQ(features[32 * i + 21], 1.0f);
    for (size_t f = 22; f < 32; ++f) EXPECT_EQ(features[32 * i + f], 0.0f);
  }
}

TEST(DeepMlpTest, ComputesLayerByLayer) {
  const FieldModel model = FrequencyModel(2, 16, 3);
  const auto inputs = NoiseBuffer(static_cast<size_t>(kPoints * model.mlp.inputs), 1);
  const MlpRun run = RunMlp(PlainKernels(), model, inputs, NoiseBuffer(kPoints * kOutputs, 2));
  const MlpWeights& mlp = model.mlp;
  for (size_t i = 0; i < kPoints; i += 50) {
    std::vector<double> h(inputs.data() + i * static_cast<size_t>(mlp.inputs),
                          inputs.data() + (i + 1) * static_cast<size_t>(mlp.inputs));
    const float* weights = mlp.parameters.data();
    for (int layer = 0; layer < mlp.layers; ++layer) {
      std::vector<double> next(static_cast<size_t>(mlp.hidden));
      for (size_t from = 0; from < h.size(); ++from) {
        for (double& sum : next) sum += h[from] * *weights++;
      }
      for (double& sum : next) sum = std::max(sum, 0.0);
      h = next;
    }
    for (size_t o = 0; o < kOutputs; ++o) {
      double sum = 0;
      for (double value : h) sum += value * *weights++;
      EXPECT_NEAR(run.raw[kOutputs * i + o], sum, 1e-4);
    }
  }
}

TEST(DeepMlpTest, PassesGradientsToWeightsAndInputs) {
  for (const int layers : {2, 4, 6}) {
    FieldModel model = FrequencyModel(2, 16, layers);
    auto inputs = NoiseBuffer(static_cast<size_t>(kPoints * model.mlp.inputs), 1);
    const auto d_raw = NoiseBuffer(kPoints * kOutputs, 2);
    const auto loss = [&] {
      model.mlp.UpdateTransposed();
      const MlpRun run = RunMlp(PlainKernels(), model, inputs, d_raw);
      double sum = 0;
      for (size_t i = 0; i < run.raw.size(); ++i) sum += d_raw[i] * run.raw[i];
      return sum;
    };
    const MlpRun run = RunMlp(PlainKernels(), model, inputs, d_raw);
    const auto expect = [&](float* x, const AlignedBuffer<float>& gradient, const char* what) {
      double largest = 0;
      for (const float g : gradient.span()) largest = std::max<double>(largest, std::fabs(g));
      ASSERT_GT(largest, 0);
      for (uint64_t check = 0; check < 80; ++check) {
        const size_t i = RandomBits(5, 6, check) % gradient.size();
        const float before = x[i];
        constexpr float kStep = 2e-4f;  // small enough that no neuron of any point crosses zero
        x[i] = before + kStep;
        const double above = loss();
        x[i] = before - kStep;
        const double below = loss();
        x[i] = before;
        EXPECT_NEAR(gradient[i], (above - below) / (2.0 * kStep), 0.01 * largest)
            << what << " " << i << " of " << layers << " layers";
      }
    };
    expect(model.mlp.parameters.data(), run.gradient, "weight");
    expect(inputs.data(), run.d_inputs, "input");
  }
}

TEST(DeepMlpTest, CloneComputesTheSame) {
  const FieldModel model = FrequencyModel(2, 32, 3), copy = model.Clone();
  const auto inputs = NoiseBuffer(static_cast<size_t>(kPoints * model.mlp.inputs), 1);
  const auto d_raw = NoiseBuffer(kPoints * kOutputs, 2);
  const MlpRun a = RunMlp(SimdKernels(), model, inputs, d_raw), b = RunMlp(SimdKernels(), copy, inputs, d_raw);
  for (size_t i = 0; i < a.raw.size(); ++i) ASSERT_EQ(a.raw[i], b.raw[i]);
  for (size_t i = 0; i < a.d_inputs.size(); ++i) ASSERT_EQ(a.d_inputs[i], b.d_inputs[i]);
}

// Signals must neither vanish nor explode in newly initialized layers.
TEST(DeepMlpTest, NewWeightsKeepTheScaleOfSignals) {
  const auto spread = [](int layers) {
    const FieldModel model = FrequencyModel(8, 64, layers);
    AlignedBuffer<float> features = Encode(SimdKernels(), model, Positions());
    const MlpRun run = RunMlp(SimdKernels(), model, features, AlignedBuffer<float>(kPoints * kOutputs));
    double squares = 0;
    for (const float raw : run.raw.span()) squares += raw * raw;
    return std::sqrt(squares / static_cast<double>(run.raw.size()));
  };
  EXPECT_GT(spread(6), 0.3 * spread(1));
  EXPECT_LT(spread(6), 3 * spread(1));
}

TEST(NeedsGeneralKernelsTest, IsTrueOnlyForModelsThatTheFastKernelsDoNotSupport) {
  EXPECT_FALSE(FieldModel(NerfConfig(), 1).NeedsGeneralKernels());
  EXPECT_TRUE(FrequencyModel(4, 16, 1).NeedsGeneralKernels());
  NerfConfig deep;
  deep.hidden_layers = 2;
  EXPECT_TRUE(FieldModel(deep, 1).NeedsGeneralKernels());
}

class GeneralKernelsTest : public ::testing::TestWithParam<int64_t> {
 protected:
  void SetUp() override { hwy::SetSupportedTargetsForTest(GetParam()); }
  void TearDown() override { hwy::SetSupportedTargetsForTest(0); }

  static void ExpectNear(const AlignedBuffer<float>& a, const AlignedBuffer<float>& b, float tolerance) {
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i) {
      ASSERT_NEAR(a[i], b[i], tolerance * (1.0f + std::fabs(a[i]))) << "value " << i;
    }
  }
};

TEST_P(GeneralKernelsTest, EncodingEqualsThePlainForm) {
  for (const int octaves : {1, 3, 10, 16}) {
    const FieldModel model = FrequencyModel(octaves, 16, 1);
    ExpectNear(Encode(PlainKernels(), model, Positions()), Encode(SimdKernels(), model, Positions()), 1e-5f);
  }
}

TEST_P(GeneralKernelsTest, MlpEqualsThePlainForm) {
  for (const auto& [width, layers] : {std::pair(16, 1), {32, 4}, {48, 2}, {256, 2}, {16, 6}}) {
    const FieldModel model = FrequencyModel(2, width, layers);
    const auto inputs = NoiseBuffer(static_cast<size_t>(kPoints * model.mlp.inputs), 1);
    const auto d_raw = NoiseBuffer(kPoints * kOutputs, 2);
    const MlpRun want = RunMlp(PlainKernels(), model, inputs, d_raw), got = RunMlp(SimdKernels(), model, inputs, d_raw);
    ExpectNear(want.raw, got.raw, 1e-4f);
    ExpectNear(want.d_inputs, got.d_inputs, 1e-4f);
    ExpectNear(want.gradient, got.gradient, 1e-4f);
  }
}

std::vector<int64_t> Targets() {
  std::vector<int64_t> targets;
  for (int64_t left = hwy::SupportedTargets(); left != 0; left &= left - 1) targets.push_back(left & -left);
  return targets;
}

INSTANTIATE_TEST_SUITE_P(Targets, GeneralKernelsTest, ::testing::ValuesIn(Targets()),
                         [](const auto& info) { return std::string(hwy::TargetName(info.param)); });

// ShrinkFeatures() has no effect without learned features; with a deep MLP on a grid it keeps the outputs.
TEST(ShrinkFeaturesTest, KeepsTheOutputs) {
  for (const char* encoding : {"hash", "frequency"}) {
    NerfConfig config;
    config.encoding = encoding;
    config.hidden_layers = 3;
    config.log2_table_entries = 10;
    CpuTrainer trainer(config, 1);
    const Positions at;
    const auto outputs = [&] {
      const FieldModel& model = trainer.model();
      return RunMlp(SimdKernels(), model, Encode(SimdKernels(), model, at), AlignedBuffer<float>(kPoints * kOutputs))
          .raw;
    };
    const AlignedBuffer<float> before = outputs();
    trainer.ShrinkFeatures(0.5f);
    const AlignedBuffer<float> after = outputs();
    for (size_t i = 0; i < before.size(); ++i) ASSERT_NEAR(before[i], after[i], 1e-5f * (1 + std::fabs(before[i])));
  }
}

}  // namespace romap::nerf::general_kernels_test
