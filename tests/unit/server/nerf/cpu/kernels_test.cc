// The kernels of every instruction set of this machine, compared with the plain form of the same formulas.
#include "server/nerf/cpu/kernels.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <bit>
#include <cmath>
#include <vector>

#include "server/nerf/math/random.h"

namespace romap::nerf::kernels_test {

float Noise(uint64_t stream, uint64_t i) { return 2.0f * RandomUniform(12, stream, i) - 1.0f; }

AlignedBuffer<float> NoiseBuffer(size_t count, uint64_t stream, float scale = 1.0f) {
  AlignedBuffer<float> buffer(count);
  for (size_t i = 0; i < count; ++i) buffer[i] = scale * Noise(stream, i);
  return buffer;
}

void ExpectNear(const AlignedBuffer<float>& a, const AlignedBuffer<float>& b, size_t count, float tolerance) {
  ASSERT_GE(a.size(), count);
  for (size_t i = 0; i < count; ++i) {
    ASSERT_NEAR(a[i], b[i], tolerance * (1.0f + std::fabs(a[i]))) << "value " << i;
  }
}

// Runs each test once per instruction set.
class KernelsTest : public ::testing::TestWithParam<int64_t> {
 protected:
  void SetUp() override { hwy::SetSupportedTargetsForTest(GetParam()); }
  void TearDown() override { hwy::SetSupportedTargetsForTest(0); }

  const KernelTable& plain_ = PlainKernels();
  static constexpr int kPoints = 101;  // not a multiple of any vector or tile size
};

TEST_P(KernelsTest, Encoding) {
  for (const int levels : {3, 8, 11}) {
    NerfConfig config;
    config.levels = levels;
    config.log2_table_entries = 10;
    const GridLayout layout = MakeGridLayout(config);
    const AlignedBuffer<float> table = NoiseBuffer(layout.entries * 2, 1);
    AlignedBuffer<float> points[3];
    for (uint64_t a = 0; a < 3; ++a) {
      points[a] = AlignedBuffer<float>(kPoints);
      for (size_t i = 0; i < kPoints; ++i) points[a][i] = RandomUniform(2, a, i);
      points[a][0] = 0.0f;
      points[a][1] = 1.0f;
    }
    const size_t size = size_t{kPoints} * static_cast<unsigned>(layout.features);
    AlignedBuffer<float> want(size), got(size);
    plain_.encode(layout, table.data(), kPoints, points[0].data(), points[1].data(), points[2].data(), want.data());
    SimdKernels().encode(layout, table.data(), kPoints, points[0].data(), points[1].data(), points[2].data(),
                         got.data());
    ExpectNear(want, got, size, 2e-3f);  // cells of the finest level amplify the rounding of positions
    const AlignedBuffer<float> d = NoiseBuffer(size, 3);
    AlignedBuffer<float> want_gradient(table.size()), got_gradient(table.size());
    plain_.encode_backward(layout, kPoints, points[0].data(), points[1].data(), points[2].data(), d.data(),
                           want_gradient.data());
    SimdKernels().encode_backward(layout, kPoints, points[0].data(), points[1].data(), points[2].data(), d.data(),
                                  got_gradient.data());
    ExpectNear(want_gradient, got_gradient, table.size(), 2e-3f);
  }
}

TEST_P(KernelsTest, Mlp) {
  for (const int hidden_width : {16, 32, 64}) {
    MlpWeights mlp(16, hidden_width);
    for (size_t i = 0; i < mlp.parameters.size(); ++i) mlp.parameters[i] = Noise(4, i);
    mlp.UpdateTransposed();
    const AlignedBuffer<float> inputs = NoiseBuffer(kPoints * 16, 5), d_raw = NoiseBuffer(kPoints * kOutputs, 6);
    const auto run = [&](const KernelTable& kernels, AlignedBuffer<float>& x, AlignedBuffer<float>& raw) {
      AlignedBuffer<float> hidden(static_cast<size_t>(kPoints * hidden_width)), gradient(mlp.parameters.size());
      x = inputs.Clone();
      raw = AlignedBuffer<float>(kPoints * kOutputs);
      kernels.mlp_forward(mlp, kPoints, x.data(), hidden.data(), raw.data());
      kernels.mlp_backward(mlp, kPoints, x.data(), hidden.data(), d_raw.data(), gradient.data());
      return gradient;
    };
    AlignedBuffer<float> want_dx, got_dx, want_raw, got_raw;
    const AlignedBuffer<float> want = run(plain_, want_dx, want_raw), got = run(SimdKernels(), got_dx, got_raw);
    ExpectNear(want_raw, got_raw, want_raw.size(), 1e-4f);
    ExpectNear(want_dx, got_dx, want_dx.size(), 1e-4f);
    ExpectNear(want, got, want.size(), 1e-4f);
  }
}

TEST_P(KernelsTest, Activation) {
  SampleChunk want(kPoints, 16, 16), got(kPoints, 16, 16);
  want.size = got.size = kPoints;
  for (size_t i = 0; i < kPoints * kOutputs; ++i) want.raw[i] = got.raw[i] = 20.0f * Noise(7, i);
  for (size_t i = 0; i < kPoints; ++i) want.length[i] = got.length[i] = 0.02f;
  plain_.activate(want, 2.0f);
  SimdKernels().activate(got, 2.0f);
  ExpectNear(want.red, got.red, kPoints, 1e-5f);
  ExpectNear(want.green, got.green, kPoints, 1e-5f);
  ExpectNear(want.blue, got.blue, kPoints, 1e-5f);
  ExpectNear(want.density, got.density, kPoints, 1e-5f);
  ExpectNear(want.alpha, got.alpha, kPoints, 1e-5f);
}

TEST_P(KernelsTest, KeepsActiveSamplesInTheirOrder) {
  constexpr int kFeatures = 16, kHidden = 32;
  constexpr float kCut = 0.5f, kScale = 0.25f;
  const auto make = [&] {
    SampleChunk chunk(kPoints, kFeatures, kHidden);
    chunk.size = kPoints;
    uint64_t stream = 20;
    for (AlignedBuffer<float>* array : {&chunk.x, &chunk.y, &chunk.z, &chunk.features, &chunk.hidden}) {
      for (size_t i = 0; i < array->size(); ++i) (*array)[i] = Noise(stream, i);
      ++stream;
    }
    // The values after the last sample are those of an earlier chunk.
    for (size_t i = 0; i < chunk.d_raw.size(); ++i) chunk.d_raw[i] = Noise(15, i / kOutputs) > 0 ? Noise(16, i) : 0.05f;
    for (size_t i = kPoints * kOutputs; i < chunk.d_raw.size(); ++i) chunk.d_raw[i] = 9.0f;
    return chunk;
  };
  const SampleChunk all = make();
  std::vector<size_t> wanted;
  for (size_t i = 0; i < kPoints; ++i) {
    float sum = 0;
    for (size_t o = 0; o < kOutputs; ++o) sum += std::fabs(all.d_raw[kOutputs * i + o]);
    if (sum > kCut) wanted.push_back(i);
  }
  ASSERT_GT(wanted.size(), 20u);
  ASSERT_LT(wanted.size(), 80u);
  for (const KernelTable* kernels : {&plain_, &SimdKernels()}) {
    SampleChunk kept = make();
    ASSERT_EQ(kernels->keep_active(kCut, kScale, kFeatures, kHidden, kept), static_cast<int>(wanted.size()));
    for (size_t to = 0; to < wanted.size(); ++to) {
      const size_t from = wanted[to];
      EXPECT_EQ(kept.x[to], all.x[from]);
      EXPECT_EQ(kept.y[to], all.y[from]);
      EXPECT_EQ(kept.z[to], all.z[from]);
      for (size_t o = 0; o < kOutputs; ++o) {
        EXPECT_EQ(kept.d_raw[kOutputs * to + o], kScale * all.d_raw[kOutputs * from + o]);
      }
      for (size_t f = 0; f < kFeatures; ++f) {
        EXPECT_EQ(kept.features[kFeatures * to + f], all.features[kFeatures * from + f]);
      }
      for (size_t h = 0; h < kHidden; ++h) EXPECT_EQ(kept.hidden[kHidden * to + h], all.hidden[kHidden * from + h]);
    }
  }
}

// Rays with 13 samples, two of which are partners, one ray without samples, and one background ray.
TEST_P(KernelsTest, Compositing) {
  constexpr int kSamples = 13, kRays = 5;
  const std::array<RaySpan, kRays> spans = {RaySpan{0, kSamples}, RaySpan{kSamples, kSamples}, RaySpan{2 * kSamples, 0},
                                            RaySpan{2 * kSamples, kSamples}, RaySpan{3 * kSamples, kSamples}};
  std::array<Ray, kRays> rays{};
  for (size_t r = 0; r < kRays; ++r) {
    rays[r].target.rgb[0] = 0.9f - 0.2f * static_cast<float>(r);
    rays[r].target.depth = 1.3f;
    rays[r].target.is_object = r < 4;
    rays[r].target.partner = r % 2 == 0 ? 1 : -1;  // rays 0 and 1; ray 2 has no samples, ray 4 is the last one
  }
  LossWeights weights;
  weights.opacity_object = weights.opacity_background = weights.depth = 0.5f;
  weights.density = 0.01f;
  weights.depth_limit = 10;
  weights.contrast = 2;
  const auto run = [&](const KernelTable& kernels, SampleChunk& chunk, std::array<RayResult, kRays>& results) {
    chunk.size = (kRays - 1) * kSamples;
    for (size_t i = 0; i < static_cast<size_t>(chunk.size); ++i) {
      chunk.t[i] = 1.0f + 0.1f * static_cast<float>(i % kSamples);
      chunk.length[i] = 0.1f;
      chunk.density[i] = 4.0f * RandomUniform(17, 0, i);
      chunk.alpha[i] = 1 - std::exp(-chunk.density[i] * chunk.length[i]);
      chunk.red[i] = RandomUniform(17, 1, i);
      chunk.green[i] = RandomUniform(17, 2, i);
      chunk.blue[i] = RandomUniform(17, 3, i);
    }
    kernels.composite(rays.data(), spans.data(), kRays, weights, chunk, results.data());
  };
  SampleChunk want(kRays * kSamples, 16, 16), got(kRays * kSamples, 16, 16);
  std::array<RayResult, kRays> want_results{}, got_results{};
  run(plain_, want, want_results);
  run(SimdKernels(), got, got_results);
  for (size_t r = 0; r < kRays; ++r) {
    EXPECT_NEAR(want_results[r].loss, got_results[r].loss, 1e-5f);
    EXPECT_NEAR(want_results[r].color_loss, got_results[r].color_loss, 1e-5f);
    EXPECT_EQ(want_results[r].loss > 0, spans[r].count > 0);
  }
  for (size_t i = 0; i < static_cast<size_t>(want.size); ++i) {
    EXPECT_NEAR(want.weight[i], got.weight[i], 1e-6f);
    EXPECT_NEAR(want.behind[i], got.behind[i], 1e-6f);
  }
  for (size_t i = 0; i < static_cast<size_t>(want.size * kOutputs); ++i) {
    EXPECT_NEAR(want.d_raw[i], got.d_raw[i], 1e-6f) << i;
  }
  // Rays whose partner has no samples have no contrast loss.
  weights.contrast = 0;
  run(plain_, want, want_results);
  EXPECT_LT(want_results[0].loss, got_results[0].loss);
  EXPECT_EQ(want_results[3].loss, got_results[3].loss);
  EXPECT_EQ(want_results[4].loss, got_results[4].loss);
}

TEST_P(KernelsTest, AdamDoesNotChangeEntriesWithoutGradient) {
  constexpr size_t kCount = 64;
  const AdamRates rates{0.01f, 0.8f, 0.95f};
  const auto run = [&](const KernelTable& kernels, AlignedBuffer<float>& first) {
    AlignedBuffer<float> p = NoiseBuffer(kCount, 8), second = NoiseBuffer(kCount, 9);
    AlignedBuffer<float> gradients[2] = {NoiseBuffer(kCount, 10), NoiseBuffer(kCount, 11)};
    first = NoiseBuffer(kCount, 12);
    for (size_t i = 0; i < kCount; ++i) second[i] = std::fabs(second[i]);
    for (size_t i = 16; i < 33; ++i) gradients[0][i] = gradients[1][i] = 0.0f;
    float* pointers[2] = {gradients[0].data(), gradients[1].data()};
    kernels.adam(rates, 0, kCount, p.data(), first.data(), second.data(), pointers, 2);
    for (const AlignedBuffer<float>& gradient : gradients) {
      for (size_t i = 0; i < kCount; ++i) EXPECT_EQ(gradient[i], 0.0f);
    }
    return p;
  };
  AlignedBuffer<float> want_first, got_first;
  const AlignedBuffer<float> want = run(plain_, want_first), got = run(SimdKernels(), got_first);
  ExpectNear(want, got, kCount, 1e-6f);
  ExpectNear(want_first, got_first, kCount, 1e-6f);
  for (size_t i = 16; i < 33; ++i) EXPECT_EQ(got[i], Noise(8, i));
}

TEST_P(KernelsTest, SamplesLieInOccupiedCellsAndInOrder) {
  std::vector<uint32_t> bits(kOccupancyResolution * kOccupancyResolution * kOccupancyResolution / 32);
  for (size_t i = 0; i < bits.size(); ++i) bits[i] = static_cast<uint32_t>(RandomBits(1, 1, i / 8));
  const SamplingRule rule{.occupied_bits = bits.data(), .extent = {1.0f, 0.7f, 0.4f}, .budget = {}};
  std::vector<Ray> rays(40);
  for (size_t r = 0; r < rays.size(); ++r) {
    Ray& ray = rays[r];
    const Eigen::Vector3f origin(-1.5f, Noise(13, r), Noise(14, r) + 0.3f);
    const Eigen::Vector3f through(RandomUniform(9, 0, r), 0.7f * RandomUniform(9, 1, r), 0.4f * RandomUniform(9, 2, r));
    const Eigen::Vector3f direction = (through - origin).normalized();
    for (int a = 0; a < 3; ++a) ray.origin[a] = origin[a], ray.direction[a] = direction[a];
    ray.jitter = RandomUniform(9, 3, r);
  }
  SampleChunk want(1024, 16, 16), got(1024, 16, 16);
  std::vector<RaySpan> want_spans(rays.size()), got_spans(rays.size());
  plain_.place_samples(rays.data(), static_cast<int>(rays.size()), rule, want, want_spans.data());
  SimdKernels().place_samples(rays.data(), static_cast<int>(rays.size()), rule, got, got_spans.data());
  ASSERT_EQ(want.size, got.size);
  ASSERT_GT(got.size, 40 * rule.budget.min_samples / 2);
  const size_t size = static_cast<size_t>(got.size);
  ExpectNear(want.x, got.x, size, 1e-5f);
  ExpectNear(want.z, got.z, size, 1e-5f);
  ExpectNear(want.t, got.t, size, 1e-5f);
  for (const RaySpan& span : got_spans) {
    for (int i = span.first; i + 1 < span.first + span.count; ++i) {
      EXPECT_LT(got.t[static_cast<size_t>(i)], got.t[static_cast<size_t>(i) + 1]);
    }
  }
  // A piece is up to 1.8 cells long, so a few samples fall next to an occupied cell.
  int occupied = 0;
  for (size_t i = 0; i < size; ++i) occupied += static_cast<int>((bits[got.cell[i] / 32] >> (got.cell[i] % 32)) & 1u);
  EXPECT_GT(occupied, 0.8 * got.size);
}

// A ray through a few occupied cells, with known positions of the samples.
TEST_P(KernelsTest, SamplesSpreadEvenlyOverTheOccupiedPieces) {
  std::vector<uint32_t> bits(kOccupancyResolution * kOccupancyResolution * kOccupancyResolution / 32);
  const auto occupy = [&](uint32_t x) { bits[((20 * 64 + 10) * 64 + x) / 32] |= 1u << (x % 32); };
  for (const uint32_t x : {3u, 4u, 31u, 32u, 63u}) occupy(x);
  // Along x through the center of row (y 10, z 20): 64 pieces, each one cell long.
  const Ray ray{{-1, 10.5f / 64, 20.5f / 64}, {1, 0, 0}, 0.5f, {}};
  const SamplingRule rule{.occupied_bits = bits.data(),
                          .extent = {1, 1, 1},
                          .budget = {.finest_step = 0.5f / 64, .min_samples = 1, .max_samples = 16}};
  for (const KernelTable* kernels : {&plain_, &SimdKernels()}) {
    SampleChunk chunk(64, 16, 16);
    RaySpan span;
    kernels->place_samples(&ray, 1, rule, chunk, &span);
    ASSERT_GE(span.count, 10);  // five pieces with two samples each, except for rounding
    ASSERT_LE(span.count, 11);
    const float pieces_per_sample = 5.0f / static_cast<float>(span.count);
    const float first_x[] = {3, 4, 31, 32, 63};
    for (int i = 0; i < span.count; ++i) {
      const float at = (static_cast<float>(i) + 0.5f) * pieces_per_sample;
      const float piece = std::floor(at);
      const size_t s = static_cast<size_t>(span.first + i);
      EXPECT_NEAR(chunk.x[s], (first_x[static_cast<int>(piece)] + at - piece) / 64, 1e-4f);
      EXPECT_NEAR(chunk.t[s], 1 + chunk.x[s], 1e-5f);
      EXPECT_NEAR(chunk.y[s], 10.5f / 64, 1e-6f);
      EXPECT_NEAR(chunk.length[s], pieces_per_sample / 64, 1e-6f);
      EXPECT_EQ(chunk.cell[s], (20u * 64 + 10) * 64 + static_cast<uint32_t>(first_x[static_cast<int>(piece)]));
    }
  }
}

TEST_P(KernelsTest, UniformSamplingSpansTheBox) {
  std::vector<uint32_t> nothing(kOccupancyResolution * kOccupancyResolution * kOccupancyResolution / 32);
  SamplingRule rule{
      .occupied_bits = nothing.data(), .extent = {1, 1, 1}, .budget = {.max_samples = 32, .skip_empty = false}};
  const Ray ray{{-1, 0.5f, 0.5f}, {1, 0, 0}, 0.5f, {}};
  SampleChunk chunk(64, 16, 16);
  RaySpan span;
  SimdKernels().place_samples(&ray, 1, rule, chunk, &span);
  ASSERT_EQ(span.count, 32);
  EXPECT_NEAR(chunk.x[0], 0.5f / 32, 1e-5f);
  EXPECT_NEAR(chunk.x[31], 31.5f / 32, 1e-5f);
  rule.budget.skip_empty = true;
  chunk.size = 0;
  SimdKernels().place_samples(&ray, 1, rule, chunk, &span);
  EXPECT_EQ(span.count, 0);
}

TEST_P(KernelsTest, RayThatMissesTheBoxGetsNoSamples) {
  const SamplingRule rule{.occupied_bits = nullptr, .extent = {1, 1, 1}, .budget = {.skip_empty = false}};
  const Ray rays[] = {{{-1, 2, 0.5f}, {1, 0, 0}, 0, {}}, {{2, 0.5f, 0.5f}, {1, 0, 0}, 0, {}}};
  SampleChunk chunk(64, 16, 16);
  RaySpan spans[2];
  SimdKernels().place_samples(rays, 2, rule, chunk, spans);
  EXPECT_EQ(spans[0].count + spans[1].count, 0);
  EXPECT_EQ(chunk.size, 0);
}

std::vector<int64_t> Targets() {
  std::vector<int64_t> targets;
  for (int64_t left = hwy::SupportedTargets(); left != 0; left &= left - 1) targets.push_back(left & -left);
  return targets;
}

INSTANTIATE_TEST_SUITE_P(Targets, KernelsTest, ::testing::ValuesIn(Targets()),
                         [](const auto& info) { return std::string(hwy::TargetName(info.param)); });

}  // namespace romap::nerf::kernels_test
